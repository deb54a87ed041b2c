"""The columns that the guide lists are those of the tables that users get."""

import re
from pathlib import Path

import pandas as pd
import pytest
from sklearn.linear_model import Ridge

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.detection import MahalanobisDetector
from skthermo.monitoring import Monitor
from skthermo.studies import DetectabilityStudy, identify_damage, sweep
from skthermo.surrogate import DataInformedFEM, PosteriorInverse, TemperatureMapper

PAGE = (Path(__file__).parents[1] / "docs" / "reference" / "data_model.rst").read_text()


@pytest.fixture(scope="module")
def year():
    return make_truss_campaign(samples_per_year=120, random_state=0)


@pytest.fixture(scope="module")
def fem(year):
    inverse = PosteriorInverse(noise=0.01)
    chain = DataInformedFEM(make_truss(), inverse=inverse, mapper=TemperatureMapper(Ridge()), random_state=0)
    return chain.fit(year.temperatures, year.frequencies)


def study(fem, year):
    scenarios, options = sweep(fem, (0.2,), ["bottom"]), {"n_repeats": 1, "uncertainty": "noise", "random_state": 0}
    return DetectabilityStudy(fem, MahalanobisDetector(), scenarios, **options).run(year.temperatures)


def update(fem, year):
    records = year.frequencies
    later = records[:5].set_index(records.index[:5] + pd.DateOffset(years=1))
    return Monitor(MahalanobisDetector(), targets=list(records), watch_per_year=12).fit(records).update(later)


def identified(fem, year):
    return identify_damage(fem, year.temperatures[:60], year.frequencies[:60], ["bottom", "top"], random_state=0).table


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(
    ("title", "table"),
    [("Results of a study", study), ("States of a monitor", update), ("Identified damage", identified)],
)
def test_the_page_lists_every_column_in_its_order(title, table, fem, year):
    section = re.split(r"\n\n.*\n-{3,}\n", PAGE.partition(f"\n{title}\n")[2])[0]
    rows = section.partition("meaning\n")[2]
    assert re.findall(r"``(\w+)``", rows.replace("``events_``", "")) == list(table(fem, year).columns)
