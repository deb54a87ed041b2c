"""Each fit lists all gross errors of its records in one error, and refuses nothing that is legal for its input."""

import warnings

import numpy as np
import pandas as pd
import pytest
from sklearn.ensemble import IsolationForest
from sklearn.linear_model import Ridge
from sklearn.pipeline import make_pipeline

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.detection import MahalanobisDetector, OutlierDetector, TemperatureCompensator
from skthermo.exceptions import RecordsWarning, SkthermoWarning
from skthermo.monitoring import track_parameters
from skthermo.studies import identify_damage
from skthermo.surrogate import DataInformedFEM, PosteriorInverse, TemperatureMapper

YEAR = make_truss_campaign(samples_per_year=120, random_state=0)
T, F = YEAR.temperatures, YEAR.frequencies
MODES = list(F)


def changed(table, column, value, rows=slice(None)):
    copy = table.copy()
    copy.iloc[rows, copy.columns.get_loc(column)] = value
    return copy


OF_FREQUENCIES = {  # what is done to a table or a column, and what the error names
    "'f1' is NaN": lambda table: changed(table, "f1", np.nan),
    "'f2' is 7": lambda table: changed(table, "f2", 7.0),
}
OF_TEMPERATURES = {
    "'T2' lies": lambda table: changed(table, "T2", table["T2"] + 273.15),
    "'T3' lies": lambda table: changed(table, "T3", table["T3"] + 273.15),
}
VALUES = {  # what is done to values, which are set aside, and what the warning names
    "'f3' is inf": lambda table: changed(table, "f3", np.inf, [5]),
    "'f4' is -999": lambda table: changed(table, "f4", -999.0, [3, 8]),
    "'f5' is 1e+06": lambda table: changed(table, "f5", 1e6, [12]),
}


def chain():
    inverse = PosteriorInverse(prior=0.2, noise=0.01)
    return DataInformedFEM(make_truss(), inverse=inverse, mapper=TemperatureMapper(Ridge()), random_state=0)


def compensator():
    return TemperatureCompensator(Ridge(), targets=MODES)


def error_of(fit, *tables):
    """The text of the error of a fit."""
    with pytest.raises(ValueError, match=r".") as refused:
        fit(*tables)
    return str(refused.value)


def subsets(faults):
    """Each fault alone, and all of them."""
    return [*((fault,) for fault in faults), tuple(faults)]


@pytest.mark.parametrize("names", subsets({**OF_FREQUENCIES, **OF_TEMPERATURES}), ids="+".join)
def test_a_chain_lists_all_errors(names):
    temperatures, frequencies = T, F
    for name in names:
        temperatures = OF_TEMPERATURES.get(name, lambda table: table)(temperatures)
        frequencies = OF_FREQUENCIES.get(name, lambda table: table)(frequencies)
    text = error_of(chain().fit, temperatures, frequencies)
    assert all(name in text for name in names)


@pytest.mark.parametrize("values", [np.nan, 12.5, [-999.0] * (len(T) - 9) + [*range(9)]], ids=["none", "one", "few"])
def test_a_sensor_that_says_nothing_is_left_out_and_named_and_changes_nothing(values):
    with pytest.warns(RecordsWarning, match="'dead'"):
        fitted = chain().fit(T.assign(dead=values), F)
    without, later = chain().fit(T, F), T.assign(dead=20.0)
    np.testing.assert_allclose(fitted.predict(later), without.predict(T), rtol=1e-9)
    np.testing.assert_allclose(fitted.predict_interval(later), without.predict_interval(T), rtol=1e-9)
    if np.size(values) > 1 or values != 12.5:  # inputs of a detector need not be temperatures, and may be constant
        with pytest.warns(RecordsWarning, match="'dead'"):
            rest = compensator().fit(T.assign(dead=values).join(F)).transform(later.join(F))
        np.testing.assert_allclose(rest, compensator().fit(T.join(F)).transform(T.join(F)), rtol=1e-9, atol=1e-12)


def test_a_chain_needs_a_sensor_that_says_something():
    assert "'T1' is 3" in error_of(chain().fit, T.assign(**dict.fromkeys(T, 3.0)), F)


@pytest.mark.parametrize("names", subsets(OF_FREQUENCIES), ids="+".join)
def test_compensators_list_all_errors(names):
    frequencies = F
    for name in names:
        frequencies = OF_FREQUENCIES[name](frequencies)
    text = error_of(compensator().fit, T.join(frequencies))
    assert all(name in text for name in names)


@pytest.mark.parametrize("name", OF_FREQUENCIES)
@pytest.mark.parametrize(
    "detector",
    [MahalanobisDetector(), OutlierDetector(IsolationForest(n_estimators=10))],
    ids=lambda d: type(d).__name__,
)
def test_detectors_name_the_column_at_fault(detector, name):
    assert name.split()[0] in error_of(detector.fit, OF_FREQUENCIES[name](F))


@pytest.mark.parametrize(
    "names", [[*VALUES], *(pytest.param([name], marks=pytest.mark.nightly) for name in VALUES)], ids="+".join
)
@pytest.mark.parametrize(
    "estimator",
    [MahalanobisDetector(), OutlierDetector(IsolationForest(n_estimators=10, random_state=0)), compensator(), chain()],
    ids=lambda e: type(e).__name__,
)
def test_values_that_cannot_be_are_as_missing_ones(estimator, names):
    given = F
    for name in names:
        given = VALUES[name](given)
    missing, tables = F.where(given == F), []
    for frequencies in (given, missing):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            if isinstance(estimator, DataInformedFEM):
                fitted = estimator.fit(T, frequencies).predict(T)
            elif isinstance(estimator, TemperatureCompensator):
                fitted = estimator.fit(T.join(frequencies)).transform(T.join(F))
            else:
                fitted = estimator.fit(frequencies).damage_index(F)
        tables.append((np.asarray(fitted), [str(one.message) for one in caught]))
    np.testing.assert_allclose(tables[0][0], tables[1][0], rtol=1e-10)
    for column in (name.split()[0] for name in names):
        assert any(column in text for text in tables[0][1])
        assert not any(column in text for text in tables[1][1])


@pytest.mark.one_case
@pytest.mark.parametrize(("unit", "factor"), [("rad/s", 2 * np.pi), ("kHz", 1e-3), ("periods", None)])
def test_another_unit_is_refused_wherever_the_model_is_known(unit, factor):
    frequencies = 1 / F if factor is None else F * factor
    fitted = chain().fit(T, F)
    for fit in (chain().fit, lambda *new: identify_damage(fitted, *new), lambda *new: track_parameters(fitted, *new)):
        assert unit in error_of(fit, T, frequencies)


def test_records_of_any_quantity_are_legal_where_no_model_is():
    random = np.random.default_rng(0)
    strains = F.assign(f1=-100 * F["f1"], f2=random.normal(0, 1e-6, len(F)))
    humidity = pd.Series(random.uniform(30, 100, len(F)), F.index)
    radiation = pd.Series(np.maximum(random.normal(0, 500, len(F)), 0), F.index)
    kelvin = T.add(273.15).add_prefix("K")
    inputs = T.assign(humidity=humidity, radiation=radiation, pressure=1013 + random.normal(0, 8, len(F)), still=1.0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SkthermoWarning)
        for table in (inputs, kelvin):
            residuals = compensator().fit(table.join(strains)).transform(table.join(strains))
            assert np.isfinite(np.asarray(residuals, dtype=float)).any()
        assert MahalanobisDetector().fit(strains).threshold_ > 0
        assert make_pipeline(compensator(), MahalanobisDetector()).fit(inputs.join(strains))[-1].threshold_ > 0


def test_residuals_are_no_frequencies():
    detector = make_pipeline(TemperatureCompensator(Ridge(), targets=MODES), MahalanobisDetector())
    with warnings.catch_warnings():
        warnings.simplefilter("error", RecordsWarning)
        assert detector.fit(T.join(F))[-1].threshold_ > 0


def test_few_new_records_may_lack_a_mode_or_be_alike():
    fitted, few = chain().fit(T, F), slice(20, 24)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = identify_damage(fitted, T[few], F[few].assign(f2=F["f2"].iloc[20], f3=np.nan), ["top"])
    assert found.records["compared"] > 0
