"""Laws of posterior modes on a reduced model: within its box, beside it, and where there is none."""

import numpy as np
import pandas as pd
import pytest
from sklearn.linear_model import Ridge

from skthermo.fem import AffineModel
from skthermo.fem.affine import ReducedModel
from skthermo.surrogate import DataInformedFEM, PosteriorInverse, TemperatureMapper
from tests.fem.frames import portal

FRAME = portal(4)
NOISE, BOUNDS = 0.001, 0.1


def inverse(**options):
    return PosteriorInverse(FRAME, noise=NOISE, prior=0.06, **options)


def records(lowest, highest, n_rows=20):
    """Air temperatures, and frequencies of a frame that the weather softens from one stiffness to the other."""
    random, stamps = np.random.default_rng(0), pd.date_range("2025", periods=n_rows, freq="D")
    share = random.uniform(size=n_rows)
    theta = (highest - (highest - lowest) * share)[:, np.newaxis] ** random.uniform(0.5, 1.0, 4)
    F = FRAME.frequencies(theta) * (1 + NOISE * random.standard_normal((n_rows, FRAME.n_modes)))
    return pd.DataFrame({"T": 30 * share}, stamps), pd.DataFrame(F, stamps).add_prefix("f")


def chain():
    paper = {"aligner": "passthrough", "discrepancy": None}
    parts = {"inverse": inverse(), "mapper": TemperatureMapper(Ridge())}
    return DataInformedFEM(FRAME, **parts, **paper, reduce=True, random_state=0)


def is_same(found, other):
    """Whether estimates differ by less than a small part of their standard deviations."""
    return bool((np.abs(found.theta - other.theta) < 0.02 * other.std).to_numpy().all())


@pytest.fixture
def made(monkeypatch):
    """Boxes of the reduced models that are made."""
    boxes = []

    def noted(cls):
        reduced = cls.reduced

        def make(self, bounds, **options):
            boxes.append(bounds)
            return reduced(self, bounds, **options)

        monkeypatch.setattr(cls, "reduced", make)

    for cls in (AffineModel, ReducedModel):
        noted(cls)
    return boxes


@pytest.fixture
def narrow(monkeypatch):
    """No basis is accurate far from the nominal state."""

    def refusing(cls):
        reduced = cls.reduced

        def make(self, bounds, **options):
            if (np.abs(np.asarray(bounds) - 1) > BOUNDS + 1e-9).any():
                raise RuntimeError("after 4 rounds, errors are larger")
            return reduced(self, bounds, **options)

        monkeypatch.setattr(cls, "reduced", make)

    for cls in (AffineModel, ReducedModel):
        refusing(cls)


@pytest.mark.nightly
def test_one_reduced_model_serves_the_inverse_and_predictions(made):
    T, F = records(0.96, 1.04, 40)
    fem = chain().fit(T, F)
    assert fem.inverse_.simulator_.reduced is not None
    assert fem.simulator_.reduced is fem.inverse_.simulator_.reduced
    assert len(made) == 1
    np.testing.assert_allclose(fem.predict(T), FRAME.frequencies(fem.predict_parameters(T)), rtol=1e-5)
    assert fem.report_.parameters.n_by_full_model == 0


@pytest.mark.nightly
def test_the_box_is_where_records_are():
    F = records(0.7, 0.95)[1]
    found, exact = (inverse(reduce=reduce).fit(F) for reduce in (True, False))
    theta = exact.transform(F).to_numpy()
    assert not found.simulator_.outside(theta).any()
    assert np.abs(np.log(found.simulator_.box / np.array([theta.min(axis=0), theta.max(axis=0)]).T)).max() < 0.3
    assert not found.invert(F).by_full_model.any()
    assert is_same(found.invert(F), exact.invert(F))


def test_rows_that_end_outside_the_box_are_solved_by_the_full_model_and_counted():
    usual = records(0.96, 1.04, 12)[1]
    F = usual.copy()
    F.iloc[[4, 7, 9]] = FRAME.frequencies(np.full((3, 4), 0.7))
    reduced, exact = inverse(reduce=True).fit(usual), inverse(reduce=False).fit(usual).invert(F)
    found = reduced.invert(F)
    outside = reduced.simulator_.outside(found.theta.to_numpy())
    np.testing.assert_array_equal(np.flatnonzero(outside), [4, 7, 9])
    np.testing.assert_array_equal(found.by_full_model, outside)
    assert is_same(found, exact)


@pytest.mark.nightly
def test_where_no_basis_is_accurate_the_full_model_is_solved(narrow):
    T, F = records(0.7, 0.95)
    with pytest.warns(UserWarning, match="(?s).*"):
        fem = chain().fit(T, F)
    assert "no reduced model is accurate" in fem.report_.solved
    found = fem.inverse_.invert(F)
    assert fem.inverse_.simulator_.reduced is fem.simulator_.reduced is None
    assert fem.report_.parameters.n_by_full_model == 0  # beside a reduced model
    assert is_same(found, inverse(reduce=False).fit(F).invert(F))
    np.testing.assert_allclose(fem.predict(T), FRAME.frequencies(fem.predict_parameters(T)), rtol=1e-9)
