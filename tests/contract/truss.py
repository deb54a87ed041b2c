"""The truss that most scripts are about: its records, and a chain that has learned them, which no script changes."""

import functools

import pandas as pd

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.surrogate import DataInformedFEM


def campaign(seed=0, n_years=1, **options):
    return make_truss_campaign(n_years, **options, random_state=seed)


def records_of(campaign):
    return campaign.temperatures.join(campaign.frequencies)


def next_year(damage):
    """Records of a damaged truss in the year after that of seed 0."""
    records = records_of(campaign(1, damage=damage))
    return records.set_index(records.index + pd.DateOffset(years=1))


def fitted(campaign):
    return DataInformedFEM(make_truss(), random_state=0).fit(campaign.temperatures, campaign.frequencies)


@functools.cache
def chain():
    """What a chain learns from the year of seed 0."""
    return fitted(campaign())
