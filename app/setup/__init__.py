"""From what a tape measure, a thermometer and a flow hood tell to an experiment: no convention to guess."""
