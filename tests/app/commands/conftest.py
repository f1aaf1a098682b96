"""The live service of the API's tests."""

from tests.app.api.conftest import live as live
