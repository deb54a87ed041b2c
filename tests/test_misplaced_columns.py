"""A mode that is left out of the targets, and a temperature among them, are named; healthy records are not."""

import os
import warnings
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from sklearn.linear_model import Ridge

from skthermo.datasets import load_z24, make_fleet, make_kw51_campaign, make_truss, make_truss_campaign
from skthermo.detection import TemperatureCompensator
from skthermo.exceptions import RecordsWarning
from skthermo.preprocessing.checks import misplaced_columns
from skthermo.surrogate import DataInformedFEM, PosteriorInverse, TemperatureMapper

YEAR = make_truss_campaign(random_state=0)
MODES = list(YEAR.frequencies)


def shared_file(name):
    folder = os.environ.get("SKTHERMO_DATA")
    if folder is None or not (Path(folder) / name).is_file():
        pytest.skip(f"SKTHERMO_DATA names no folder with {name}")
    return Path(folder) / name


def z24():
    bridge = load_z24(shared_file("z24/z24_monitoring.csv"))
    return bridge.temperatures, bridge.frequencies


def tower():
    log = pd.read_csv(shared_file("tower/tower.csv"), index_col=0)
    return log[["T1", "T2"]], log.drop(columns=["T1", "T2"])


def of_fleet():
    records = next(iter(make_fleet(1, random_state=0).values())).records(365)
    return records.temperatures, records.frequencies


def tables(year):
    return year.temperatures, year.frequencies


RECORDS = {
    "truss": lambda: tables(YEAR),
    "truss with gaps": lambda: tuple(table.mask(table.to_numpy() * 1000 % 10 < 1) for table in tables(YEAR)),
    "KW51": lambda: tables(make_kw51_campaign(random_state=0)),
    "fleet": of_fleet,
    "Z24": z24,
    "tower": tower,
}


@pytest.mark.one_case
@pytest.mark.parametrize("records", RECORDS.values(), ids=RECORDS)
def test_every_misplaced_column_is_named_and_no_other(records):
    T, F = records()
    both = pd.concat([T, F], axis=1)
    assert not list(misplaced_columns(T, F))
    for mode in F:
        (warning,) = misplaced_columns(both[[*T, mode]], F.drop(columns=mode))
        assert f"[{mode!r}]" in str(warning)
    for sensor in T if T.shape[1] > 1 else ():
        (warning,) = misplaced_columns(T.drop(columns=sensor), both[[sensor, *F]])
        assert f"[{sensor!r}]" in str(warning)


def test_units_do_not_matter():
    T, F = tables(YEAR)
    both = pd.concat([T, F * 1000], axis=1)
    (warning,) = misplaced_columns(both[[*T, "f2", "f4"]], both[["f1", "f3"]])
    assert "['f2', 'f4']" in str(warning)


def test_other_quantities_are_no_modes():
    T, F = tables(YEAR)
    random = np.random.default_rng(0)
    pressure = 101.3 + random.normal(0, 0.8, len(T))
    humidity = np.clip(70 - T["T1"] + random.normal(0, 10, len(T)), 5, 100)
    soil = 10.0 + 0.05 * T["T1"].rolling(60, min_periods=1).mean()
    assert not list(misplaced_columns(T.assign(pressure=pressure, humidity=humidity, soil=soil), F))
    strain = F.assign(strain=12.0 * T["T1"] + random.normal(0, 5, len(T)))
    assert not list(misplaced_columns(T, strain))


@pytest.mark.nightly
def test_the_warning_comes_from_fit():
    both = YEAR.temperatures.join(YEAR.frequencies)
    with pytest.warns(RecordsWarning, match="'f4'"):
        TemperatureCompensator(Ridge(), targets=[name for name in MODES if name != "f4"]).fit(both)
    with pytest.warns(RecordsWarning, match="'T2'"):
        TemperatureCompensator(Ridge(), targets=[*MODES, "T2"]).fit(both)
    inverse = PosteriorInverse(noise=0.01)
    chain = DataInformedFEM(make_truss(5), inverse=inverse, mapper=TemperatureMapper(Ridge()), random_state=0)
    with pytest.warns(RecordsWarning, match="'f6'"):
        chain.fit(YEAR.temperatures.join(YEAR.frequencies["f6"]), YEAR.frequencies[MODES[:5]])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        chain.fit(YEAR.temperatures, YEAR.frequencies[MODES[:5]])
        TemperatureCompensator(Ridge(), targets=MODES).fit(both)


@pytest.mark.parametrize("targets", ["f1", 3, {"f1": 1}, {"f1"}, None, str])
def test_targets_that_are_no_list_are_refused(targets):
    with pytest.raises(ValueError, match="targets is"):
        TemperatureCompensator(Ridge(), targets=targets).fit(YEAR.temperatures.join(YEAR.frequencies))
