"""Records of the truss: the same seed gives the same bits, damage and drift begin where they are asked for."""

from skthermo.datasets import make_truss_campaign

year = make_truss_campaign(random_state=0)
chord = {"drift": {"bottom": 0.01}, "damage": {"bottom": 0.12}, "damage_from": "2028-01-01"}
f1 = make_truss_campaign(4, **chord, random_state=0).clean_frequencies["f1"]
hourly = make_truss_campaign(samples_per_year=48, samples_per_day=24, noise=0.005, correlation=0.5, random_state=1)
RESULTS = {
    "columns": [*year.temperatures, *year.frequencies],
    "stamps": [str(year.temperatures.index[n]) for n in (0, 1, -1)],
    "first temperatures": year.temperatures[:3],
    "first frequencies": year.frequencies[:3],
    "clean": year.clean_frequencies.mean(),
    "means of years": f1.groupby(f1.index.year).mean(),
    "hourly": hourly.frequencies.iloc[-1],
}
TOLERANCES = {"*": {"rtol": 1e-8}}
