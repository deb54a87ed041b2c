"""One BLAS thread for each worker of the tests, which share the machine's cores; figures without a screen; the same
drawn examples in each run; little time for the garbage collector; chains of examples, most of which are the same,
fitted once."""

import copy
import functools
import gc
import os
import sys

import pytest
from hypothesis import HealthCheck, settings

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")

os.environ.setdefault("MPLBACKEND", "Agg")
on_any_machine = {"deadline": None, "suppress_health_check": list(HealthCheck)}
settings.register_profile("fixed", derandomize=True, **on_any_machine)
settings.register_profile("others", **on_any_machine)  # ``--hypothesis-profile others`` draws other examples
settings.load_profile("fixed")
collect_ignore = [f"tests/bad_input/{name}.py" for name in ("examples", "in_service")]  # test_bad_input imports them
FITTED = {}  # what chains of examples have learned, by all that tells them and their records from others
gc.set_threshold(50_000)  # by default 700: a fifth of the time in which tests are collected


def pytest_collection_modifyitems(items):
    """Of a test marked ``one_case``, the first case is tried each time, the others at night."""
    begun = set()
    for item in items:
        if item.get_closest_marker("one_case"):
            test = item.nodeid.partition("[")[0]
            if test in begun:
                item.add_marker(pytest.mark.nightly)
            begun.add(test)


def pytest_collection_finish(session):
    """What modules hold stays until the end: the garbage collector need not look through it."""
    gc.collect()
    gc.freeze()


@pytest.fixture(scope="session")
def shared_folder(tmp_path_factory):
    """Gives the folder of a name, which the first worker that asks fills for all; none changes what is in it."""
    from skthermo._core.files import alone_with

    root = tmp_path_factory.getbasetemp()
    root = root.parent if "PYTEST_XDIST_WORKER" in os.environ else root

    def folder(name, fill):
        made = root / name
        with alone_with(made, 600):
            if not (made / "complete").exists():
                made.mkdir(exist_ok=True)
                fill(made)
                (made / "complete").touch()
        return made

    return folder


@pytest.fixture
def chains_fitted_once(monkeypatch):
    """A chain that was fitted to the same records before becomes a copy of what it learned then."""
    import joblib

    from skthermo.surrogate import DataInformedFEM

    fit = DataInformedFEM.fit

    @functools.wraps(fit)
    def once(fem, *records, **options):
        settings = {name: value for name, value in vars(fem).items() if not name.endswith("_")}
        key = joblib.hash((settings, records, options))
        if key not in FITTED:
            fit(fem, *records, **options)
            FITTED[key] = copy.deepcopy({name: value for name, value in vars(fem).items() if name not in settings})
        vars(fem).update(copy.deepcopy(FITTED[key]))
        return fem

    monkeypatch.setattr(DataInformedFEM, "fit", once)


@pytest.fixture(autouse=True)
def _chains_of_docstrings_are_fitted_once(request):
    if isinstance(request.node, pytest.DoctestItem):
        request.getfixturevalue("chains_fitted_once")


@pytest.fixture(scope="session", autouse=True)
def _the_same_records_are_checked_once():
    """Most tests learn from one of a few years, which estimators would check again each time."""
    import joblib

    import skthermo.detection
    import skthermo.surrogate  # noqa: F401
    from skthermo.preprocessing import check_records

    found = {}

    @functools.wraps(check_records)
    def once(*tables, **options):
        try:
            key = joblib.hash((tables, options))
        except Exception:  # of what cannot be pickled
            return check_records(*tables, **options)
        if key not in found:
            found[key] = check_records(*tables, **options)
        return copy.deepcopy(found[key])

    users = [name for name in sys.modules if name.startswith(("skthermo.detection.", "skthermo.surrogate."))]
    with pytest.MonkeyPatch.context() as patched:
        for module in (sys.modules[name] for name in users):
            if getattr(module, "check_records", None) is check_records:
                patched.setattr(module, "check_records", once)
        yield
