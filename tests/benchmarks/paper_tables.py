"""The tables of Kamali et al. (2026) beside the paper's chain here, with and without dropout, and the default chain.

    OMP_NUM_THREADS=1 python tests/benchmarks/paper_tables.py --parts truss
    OMP_NUM_THREADS=1 python tests/benchmarks/paper_tables.py --parts kw51
    OMP_NUM_THREADS=1 python tests/benchmarks/paper_tables.py --parts appendix
    OMP_NUM_THREADS=1 python tests/benchmarks/paper_tables.py --parts lines reduced

The truss has realisations of noise and weather, KW51 the synthetic campaigns of seeds 100 and 0, as the measurements
are not tried. ``lines`` runs the code on the method page as it stands there; ``reduced`` is KW51's chain with a reduced
model beside the full one.
"""

import time

import numpy as np
import pandas as pd
from harness import EXAMPLES, arguments, recipes, shown
from kw51_recipes import BASELINE, CHAINS, DEFAULT, PUBLISHED, TRAINED, WITHOUT, Fitted, Records, bridge, rates
from sklearn.base import clone
from truss_tables import HALVED_NAMES, NAMES, PAPER_ALARMS, PAPER_ERRORS, SingleRecords, detectable

from skthermo.datasets import make_kw51, make_kw51_campaign, make_truss
from skthermo.surrogate import DataInformedFEM, paper_chain, paper_network
from skthermo.updating import sensitivity

tables, appendix, truss = recipes("kw51_tables"), recipes("kw51_appendix"), recipes("truss")
KW51_SEEDS = (100, 0)


def truss_chains():
    """The paper's chain of the truss, the same without dropout, and the default chain."""
    published = paper_chain(make_truss(), bounds=0.2)
    network = paper_network("truss", dropout=False)
    without = clone(published).set_params(inverse__regressor=network, mapper__regressor=network)
    return {PUBLISHED: published, WITHOUT: without, DEFAULT: DataInformedFEM(make_truss())}


def truss_part(seeds):
    """Tables 2 and 3, the smallest damage found, and the healthy years one by one."""
    each = {seed: SingleRecords(seed, truss_chains()) for seed in range(seeds)}
    errors = [one.errors() for one in each.values()]
    by_state, by_mode = (
        pd.DataFrame({name: sum(found[name].mean(axis=axis) for found in errors) / seeds for name in CHAINS})
        for axis in (1, 0)
    )
    by_state.insert(0, "paper", PAPER_ERRORS.mean(axis=1))
    by_mode.insert(0, "paper", PAPER_ERRORS.mean().to_numpy())
    by_state.index = [f"{truss.papers_name(name)}, mean of modes" for name in HALVED_NAMES]
    by_mode.index = [f"f{mode}, mean of states" for mode in range(1, 7)]
    table = pd.concat([by_state, by_mode, by_mode.mean().to_frame("all").T])
    shown(f"Table 2, MAPE in %: the paper's realisation, and means of {seeds} here", table)

    found = {seed: one.rates() for seed, one in each.items()}
    mean = sum(found.values()) / seeds
    columns = {"thermo": "thermo-mechanical", **{name: f"data-informed, {name}" for name in CHAINS}}
    table = mean[list(columns)].rename(columns=columns)
    table.insert(0, "paper, thermo-mechanical", PAPER_ALARMS["reference"])
    table.insert(1, "paper, data-informed", PAPER_ALARMS["simulated"])
    gaps = {name: np.mean([(one[name] - one["thermo"]).abs().mean() for one in found.values()]) for name in CHAINS}
    difference = {columns[name]: gap for name, gap in gaps.items()}
    difference["paper, data-informed"] = (PAPER_ALARMS["simulated"] - PAPER_ALARMS["reference"]).abs().mean()
    table.index = [truss.papers_name(name) for name in NAMES]
    table.loc["mean difference, points"] = pd.Series(difference)
    shown(f"Table 3, alarms in %: the paper's realisation, and means of {seeds} here", table)

    smallest = {name: detectable(pd.concat(found, names=["seed", "scenario"]), name) for name in ("thermo", *CHAINS)}
    paper = {"paper, by its rates": {"bottom": 20, "top": 30, "diagonal": 20}, "paper, its text": truss.PAPER_SMALLEST}
    table = pd.DataFrame(paper | smallest).rename(columns={"thermo": "thermo-mechanical"})
    shown("Smallest loss found in 90 % of the records, %", table, 0)

    healthy = pd.DataFrame({seed: rates_.loc["healthy", ["thermo", *CHAINS]] for seed, rates_ in found.items()}).T
    for part in ("inverse_", "mapper_"):
        scores = [getattr(one.fems[PUBLISHED], part).regressor_.validation_score_ for one in each.values()]
        healthy[f"R2 of {'M1' if part == 'inverse_' else 'M2'}, rows held out"] = scores
    healthy = healthy.rename(columns={"thermo": "thermo-mechanical"}).rename_axis("realisation")
    shown("SH-0 in each realisation, false alarms in %", healthy)


def kw51_part(seeds):
    """Tables 5, 7, 8, 9 and the retrofit."""
    records = {seed: Records.read(seed=seed) for seed in seeds}
    fits = {(seed, name): Fitted.by(records[seed], name) for seed in seeds for name in CHAINS}
    of_seed = {seed: {name: fits[seed, name] for name in CHAINS} for seed in seeds}
    by_seed = {
        "Table 5, MAPE of M1 in %, 200 simulations": lambda seed: tables.table_5(bridge(), of_seed[seed]),
        "Table 7, MAPE of M2 in %, 800 records": lambda seed: tables.table_7(of_seed[seed]),
        "Table 8, MAPE of frequencies in %, 800 records": lambda seed: tables.table_8(records[seed], of_seed[seed]),
    }
    for title, table in by_seed.items():
        found = {seed: table(seed) for seed in seeds}
        names = [name for name in found[seeds[0]] if name != "paper"]
        of_each = {f"{name}, seed {seed}": found[seed][name] for name in names for seed in seeds}
        both = pd.DataFrame({"paper": found[seeds[0]]["paper"]} | of_each)
        shown(title, pd.concat([both, both.mean().to_frame("mean").T]), 3)
    shown("Table 9, damage index by modes 2 and 4", table_9(fits))
    shifts = {f"seed {seed}": tables.table_of_retrofits(records[seed], fits[seed, DEFAULT]) for seed in seeds}
    shown("The retrofit, shifts of the modes in %", pd.concat(shifts, names=["campaign", "mode"]))


def table_9(fits):
    """Rates of alarms, means and deviations of the index, and threshold; simulations are without noise."""
    names = {"healthy": "pre-retrofit testing", "retrofit": "post-retrofit"}
    columns = {"alarms, %": "alarms, %", "mean index": "mean DI", "deviation": "std. DI"}
    paper = pd.DataFrame(tables.PAPER_9, index=list(columns)).T
    found = {"paper": (paper, 3.014)}
    for (seed, name), fitted in fits.items():
        indices, threshold = fitted.detection(0.0)
        found[f"{name}, seed {seed}"] = rates(indices, threshold), threshold
    table = {}
    for name, (values, threshold) in found.items():
        rows = {
            f"{columns[what]}, {names[state]}, {'data-informed' if source == 'simulated' else 'experimental'}": value
            for what in columns
            for (state, source), value in values[what].items()
        }
        table[name] = rows | {"threshold": threshold}
    return pd.DataFrame(table)


def appendix_part():
    """Tables A.3 and A.5; no chain has a part in them."""
    paper = pd.DataFrame(appendix.PAPER_A3, index=appendix.MODES).T
    here = sensitivity(make_kw51("all")).T.loc[paper.index]
    both = pd.concat({"paper": paper, "here": here}, axis=1).swaplevel(axis=1)[appendix.MODES]
    both.columns = [f"{mode}, {source}" for mode, source in both.columns]
    shown("Table A.3, sensitivities of the modes", both, 3)
    here = tables.table_of_updating()
    columns = {"experimental, Hz": here["measured, Hz"]}
    for when, name in (("before", "un-updated"), ("after", "updated")):
        for source, f in (("paper", appendix.PAPER_A5[when]), ("here", here[when])):
            columns[f"{name}, {source}, Hz"] = np.asarray(f)
            columns[f"error, {name}, {source}, %"] = 100 * np.abs(np.asarray(f) / appendix.MEASURED - 1)
    table = pd.DataFrame(columns, index=here.index)
    table.loc["mean"] = table.filter(like="error").mean()
    shown("Table A.5, frequencies before and after updating", table, 3)


def lines_part(seeds):
    """Seconds and results of the code on the method page, for the truss and for KW51."""
    recipes = EXAMPLES.parent / "docs" / "guide" / "recipes"
    of_truss, of_kw51 = ((recipes / f"paper_chain_{name}.py").read_text() for name in ("truss", "kw51"))
    rows = {}
    for name, code, numbers in (("truss", of_truss, range(4)), ("KW51", of_kw51, seeds)):
        for seed in numbers:
            names = {}
            _, seconds = timed(exec, code.replace("seed = 0", f"seed = {seed}"), names)
            rows[f"{name}, seed {seed}"] = {
                "processor seconds": seconds,
                "error of frequencies, mean of modes, %": np.mean(names["errors"]),
                "false alarms, measured, %": 100 * np.mean(names["measured"]),
                "the same, simulated, %": 100 * np.mean(names["simulated"]),
            }
    shown("The lines of the method page", pd.DataFrame(rows).T)


def reduced_part():
    """Seconds of KW51's chain by the full model, as published, and by a reduced one."""
    campaign = make_kw51_campaign(n_hours=BASELINE, random_state=0)
    T, F, found = campaign.temperatures, campaign.frequencies, {}
    for reduce in ("auto", False):
        fem = paper_chain(make_kw51(updated=True), network="kw51", lags=24, random_state=0).set_params(reduce=reduce)
        found[reduce] = timed(lambda fem=fem: fem.fit(T[:TRAINED], F[:TRAINED]).predict(T))
    (reduced, fast), (full, slow) = found.values()
    row = {
        "full model, processor seconds": slow,
        "reduced model, processor seconds": fast,
        "share": fast / slow,
        "largest relative difference of a frequency": np.nanmax(np.abs(reduced / full - 1)),
    }
    title = "The paper's chain on KW51, fit to 3200 and predictions of 4000 records"
    shown(title, pd.DataFrame({"KW51": row}).T, "2g")


def timed(call, *arguments):
    """What a call gives, and the processor seconds that it takes."""
    began = time.process_time()
    return call(*arguments), time.process_time() - began


def main():
    parts = ["truss", "kw51", "appendix", "lines", "reduced"]
    options = arguments(__doc__, parts=parts, seeds=(4, "realisations of the truss"), campaigns=list(KW51_SEEDS))
    if "truss" in options.parts:
        truss_part(options.seeds)
    if "kw51" in options.parts:
        kw51_part(options.campaigns)
    if "appendix" in options.parts:
        appendix_part()
    if "lines" in options.parts:
        lines_part(options.campaigns)
    if "reduced" in options.parts:
        reduced_part()


if __name__ == "__main__":
    main()
