"""The paper's implicit representation: a network from position to (T, p, u), with its derivatives."""

from core.mlp.network import Mlp, MlpSettings, initial_mlp

__all__ = ["Mlp", "MlpSettings", "initial_mlp"]
