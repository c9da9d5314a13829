"""Profiles of the property tests by FILIPPOV_PROFILE: "ci" for more examples, "nightly" for many more."""

import gc
import os

# Matrices here are small: threads of the linear algebra only wait for each other. Read as numpy is imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import pytest
from hypothesis import HealthCheck, settings

# A worker holds hundreds of systems by the end; the collector of cycles looks through them less often.
gc.set_threshold(50_000, 20, 50)

settings.register_profile(
    "default", max_examples=40, deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.register_profile("ci", parent=settings.get_profile("default"), max_examples=100)
settings.register_profile("nightly", parent=settings.get_profile("default"), max_examples=2000)
settings.load_profile(os.environ.get("FILIPPOV_PROFILE", "default"))


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """A test of the nightly profile may take hours."""
    if os.environ.get("FILIPPOV_PROFILE") != "nightly":
        return
    for item in items:
        if item.get_closest_marker("timeout") is None:
            item.add_marker(pytest.mark.timeout(36_000))
