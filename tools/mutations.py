"""Whether the tests notice mistakes in the numerics of modal analysis, updating, surrogates and detection.

    OMP_NUM_THREADS=1 python tools/mutations.py [--jobs 2] [WORD ...]

Each mutation is a mistake that somebody could make: a sign, a factor, a dropped term, another constant. It is written
into a temporary copy of the package, where the tests named beside it must fail. Prints "killed" or "SURVIVED" for
each, and those that survived again at the end. The exit code is 1 if one survived: a test is then missing.
"""

import argparse
import os
import queue
import shutil
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).parents[1]
COPIED = ("skthermo", "tests", "conftest.py", "pyproject.toml")

MUTATIONS = {  # file and tests: what breaks, original text, mutated text
    ("datasets/_fleet_site.py", "datasets/test_fleet.py"): [
        ("weather of another variance", "np.sqrt(1 - decay**2) * noise[1:]", "(1 - decay) * noise[1:]"),
        ("a law that is not reversed in frost", '"gain": -law.gain}', '"gain": law.gain}'),
    ],
    ("monitoring/_retraining.py", "monitoring/test_retraining.py"): [
        ("records of an event train", "masked.loc[inside, columns] = np.nan", "pass"),
        ("old weeks that never fade", "moved[np.minimum(distance, YEAR / DAY - distance).min(axis=1) > 3.5]", "moved"),
    ],
    ("monitoring/_drift.py", "monitoring/test_drift_follower.py"): [
        ("follower takes out doubtful drift", "np.r_[0.0, self.evidence]", "np.r_[-99.0, self.evidence]"),
        ("sudden days are learned", "if self._is_apart(state.learned, waiting):", "if False:"),
    ],
    ("fem/modal/_modes.py", "fem/test_tracking.py"): [
        ("repeated modes", "REPEATED = 1e-6", "REPEATED = 0.0"),
    ],
    ("fem/modal/_core.py", "fem/test_tracking.py"): [
        ("doubt about a tracked mode", "assigned < left", "assigned < left / 4"),
        ("two modes paired with one", "np.flatnonzero(~distinct)", "np.flatnonzero(~distinct)[:0]"),
        ("order within repeated modes", "np.sort(best[:, cluster], axis=1)", "best[:, cluster]"),
    ],
    ("monitoring/_sensors.py", "monitoring/test_sensors.py"): [
        ("damage taken for exchanged modes", "(there < here / 4).all(axis=1)", "(there < 4 * here).all(axis=1)"),
        ("which of two thermometers is wrong", "if len(resolved) == 1:", "if resolved:"),
    ],
    ("fem/_factors.py", "fem/test_factors.py"): [
        ("pivots of an indefinite matrix", "(factors.U.diagonal() > 0).all()", "True"),
    ],
    ("fem/modal/_sparse.py", "fem/test_sparse.py"): [
        ("guard vectors of an iteration", "GUARD_VECTORS = 2", "GUARD_VECTORS = 0"),
    ],
    ("fem/modal/_modes.py", "fem/test_local_modes.py"): [
        ("convergence of shape derivatives", "1e-5**2 * (known", "1e-1**2 * (known"),
        ("massless degrees of freedom", "(x + residuals)[:, ~going]", "x[:, ~going]"),
        ("shape derivative along the mode itself", "-d_masses / 2", "-d_masses"),
        ("shape derivative along other modes", "along / np.where", "-along / np.where"),
    ],
    ("_core/arrays.py", "fem/test_linearise.py"): [
        ("one-sided differences", "known.any(axis=0), known.sum(axis=0)", "known.any(axis=0), 2"),
    ],
    ("fem/_evaluate.py", "fem/test_linearise.py"): [
        ("relative derivatives", "jacobian * rows[:, np.newaxis] / freq", "jacobian / freq"),
    ],
    ("fem/modal/_core.py", "fem/test_local_modes.py"): [
        ("shape derivatives of tracked modes", "follow=self.track, basis", "follow=False, basis"),
    ],
    ("fem/_evaluate.py", "fem/test_modes_at_sensors.py"): [
        ("signs of shapes beside theta", "return there * np.sign(", "return there * np.abs("),
    ],
    ("monitoring/_fleet.py", "monitoring/test_fleet.py"): [
        ("bridges whose records failed called healthy", "if self.error else status", "if False else status"),
    ],
    ("surrogate/_fleet_mapper.py", "surrogate/test_fleet_mapper.py"): [
        ("bridges unlike the others", "(1.0, 10.0, 100.0)", "(1.0,)"),
    ],
    ("fem/_evaluate.py", "fem/test_progress.py"): [
        ("one warning of many chunks", "model.quiet() if thread_safe else model", "model"),
    ],
    ("fem/affine/_affine.py", "fem/test_reduced.py"): [
        ("box of a rescaled model", "_bounds=self._bounds / row.T", "_bounds=self._bounds"),
    ],
    ("fem/modal/_core.py", "fem/test_laws.py"): [
        ("mass in the jacobian", "gradient -= eigenvalues", "gradient += eigenvalues"),
    ],
    ("fem/modal/_core.py", "updating/test_pairing.py"): [
        ("modes beyond those of the model", "GUARD_MODES = 4", "GUARD_MODES = 0"),
    ],
    ("updating/_residuals.py", "updating/test_pairing.py"): [
        ("pairing where sensors are few", "0.25 * modes.nominal_mac", "0.0 * modes.nominal_mac"),
    ],
    ("updating/_residuals.py", "updating/test_updater.py"): [
        ("derivative of tangents", "d_along / along**2", "d_along / along"),
        ("slope of the loss", "weights * E / (secant * (1 + secant))", "weights * E / (1 + secant)"),
        ("prior", "(theta - 1) / prior", "theta / prior"),
        ("derivative of the prior", "np.diag(1 / prior)", "np.diag(prior)"),
        ("information of shapes", "np.sqrt(2 * max(n_dofs - 1, 1))", "np.sqrt(max(n_dofs - 1, 1))"),
        ("number of residuals", "max(len(self.dofs) - 1, 0)", "len(self.dofs)"),
        ("convergence beside failures", "success = bool(result.success) and", "success = bool(result.success) or"),
    ],
    ("updating/_identifiability.py", "updating/test_sensitivity.py"): [
        ("noise of shapes", "np.sqrt(len(shapes)) / shape_noise", "1 / shape_noise"),
        ("parameters distinguished", "values > 1e-6 * values[0]", "values >= 0"),
    ],
    ("updating/_residuals.py", "updating/test_ensemble.py"): [
        ("models that are all the most probable one", "* self.values - residuals.noise", "* self.values"),
    ],
    ("updating/_updater.py", "updating/test_ensemble.py"): [
        ("stiffness that a parameter scales drawn twice", "if terms <= own)) == own", "if terms < own)) == own"),
    ],
    ("updating/_diagnostics.py", "updating/test_updater.py"): [
        ("numbers of the optima", 'np.argsort(table["objective"], kind="stable")', "range(len(table))"),
    ],
    ("surrogate/_posterior.py", "surrogate/test_posterior_inverse.py"): [
        ("weight of rows with gaps", "((at_best / std) ** 2)", "(at_best / std)"),
        ("the common factor", "return self.common**2 + np.diag(self.own**2)", "return np.diag(self.own**2)"),
    ],
    ("surrogate/_records.py", "surrogate/test_sample_weight.py"): [
        ("residuals of records of weight 0", "measured).all(axis=1) & self.counted", "measured).all(axis=1)"),
    ],
    ("_core/frames.py", "surrogate/test_sample_weight.py"): [
        ("weights of a series by index", "sample_weight.reindex(X.index)", "sample_weight"),
    ],
    ("_core/estimators.py", "surrogate/test_sample_weight.py"): [
        ("weights routed as requested", "is not regressor and routes_weights(regressor):", "is not regressor:"),
    ],
    ("surrogate/_simulator.py", "surrogate/test_shape_inputs.py"): [
        ("relative derivatives of shapes", "shapes, slopes * at[:, np.newaxis]", "shapes, slopes"),
    ],
    ("residuals/sensors.py", "residuals/test_sensors.py"): [
        ("sensors in unknown weather", "outside = beyond > 0", "outside = beyond > 1e9"),
        ("usual departures of sensors", "np.fmax(3 * usual, least)", "np.fmax(0.5 * usual, least)"),
    ],
    ("residuals/weather.py", "residuals/test_doubts.py"): [
        ("growth outside the weather", "1 + np.log1p(self.reach", "1 + 0 * np.log1p(self.reach"),
    ],
    ("detection/_base.py", "detection/test_thresholds.py"): [
        ("blocks longer than the memory", "np.clip(number / 4, 5, 50)", "50"),
    ],
    ("residuals/baseline.py", "residuals/test_baseline.py"): [
        ("spread of the same period", "np.where(test[:, np.newaxis], np.nan, self.values)", "self.values"),
        ("spread beyond the range", " * (1 + beyond)[:, np.newaxis]", ""),
        ("order statistic", "(len(scores) + 1) * confidence", "len(scores) * confidence"),
    ],
    ("surrogate/_records.py", "surrogate/test_uncertainty.py"): [
        (
            "periods of time",
            'kind="stable")\n        order = order[known[order]]\n        inputs',
            'kind="stable")\n        order = np.flatnonzero(known)\n        inputs',
        ),
    ],
    ("residuals/sensors.py", "surrogate/test_uncertainty.py"): [
        ("cost of filled temperatures", "np.nan_to_num(changes) ** 2 / 2", "0 * np.nan_to_num(changes)"),
    ],
    ("_core/frames.py", "surrogate/test_uncertainty.py"): [
        ("correlation time", "1 + 2 * correlations[:n_clear]", "1 + correlations[:n_clear]"),
    ],
    ("preprocessing/folds.py", "preprocessing/test_folds.py"): [
        ("blocks dealt in turn", "blocks % self.n_splits", "blocks * self.n_splits // (blocks.max() + 1)"),
    ],
    ("_core/matlab.py", "test_matlab.py"): [
        ("a part too many in a file", "len(parts) != n_values", "len(parts) < n_values"),
        ("unsorted rows in a file", "if not matrix.has_canonical_format", "if False"),
    ],
    ("fem/external/_texts.py", "fem/test_exported_texts.py"): [
        ("entries on both sides in a file", "if paired or in_order", "if paired"),
    ],
    ("preprocessing/_poles.py", "preprocessing/test_mode_tracker.py"): [
        ("drift of tracked modes", "np.clip(mean, lowest, highest)", "mean"),
        ("poles of tracked modes contested", "counts[inverse] > 1", "counts[inverse] > 2"),
    ],
    ("datasets/_kw51_campaign.py", "datasets/test_kw51_campaign.py"): [
        ("mass of a retrofit", '{"retrofit": retrofit_mass()}', '{"retrofit": retrofit_mass() / 2}'),
    ],
    ("preprocessing/checks/_columns.py", "preprocessing/test_checks.py"): [
        ("stuck sensors beside rounding", "lengths if ((lengths > 1)", "lengths[:0] if ((lengths > 1)"),
        ("stuck sensors beside resting values", "lengths[levels == levels[run]]", "lengths[:0]"),
        ("stuck sensors at all", "lengths[longest] >= 5", "lengths[longest] >= 500"),
    ],
    ("preprocessing/checks/_beside_weather.py", "preprocessing/test_checks.py"): [
        ("inertia as a time shift", "strength[farthest - 1 : farthest + inertia + 1] = 0", "strength[farthest] = 0"),
        ("exchanged modes that cross", "        if np.sqrt(ratio.prod()) < 0.5:", "        if True:"),
    ],
    ("preprocessing/_hampel.py", "preprocessing/test_hampel.py"): [
        ("outliers where records scatter more", "np.fmax(local, self.deviations_", "np.fmin(local, self.deviations_"),
    ],
    ("preprocessing/_transformers.py", "preprocessing/test_hinges.py"): [
        ("places of knots", "self.n_knots + 2)[1:-1]", "self.n_knots + 2)[:-2]"),
        ("weighted quantiles", "shares * (position[-1] - window)", "shares * position[-1]"),
    ],
    ("residuals/gaussian.py", "detection/test_gaps.py"): [
        ("spread of missing modes", "+ counts[:, np.newaxis, np.newaxis] * rest", ""),
        (
            "mean of modes with gaps",
            "counts.sum() - np.outer(step, step)\n    return np.concatenate([[mean + step], (updated",
            "counts.sum() - np.outer(step, step)\n    return np.concatenate([[mean], (updated",
        ),
    ],
    ("detection/_mahalanobis.py", "detection/test_gaps.py"): [
        ("distances in few modes", "here, there = 2 / (9 * n_present)", "here, there = 2 / (8 * n_present)"),
    ],
    ("preprocessing/_past.py", "preprocessing/test_lags.py"): [
        ("records that lags reach to", "max(self.lags_) * freq + tolerance", "max(self.lags_) * freq"),
    ],
    ("detection/_base.py", "detection/test_mahalanobis.py"): [
        ("rows that cannot be evaluated", "np.where(unknown, 0, ", "np.where(unknown, 1, "),
    ],
    ("_core/parallel.py", "test_threads.py"): [
        ("limits around threads", "if effective_n_jobs(n_jobs) > 1 else", "if effective_n_jobs(n_jobs) > 9 else"),
    ],
    ("monitoring/_drift.py", "monitoring/test_track_parameters.py"): [
        ("weather beside drift", "fit_transform(parts), parts**3])", "fit_transform(0 * parts), 0 * parts])"),
        ("noise that lasts for months", "if n_waves:", "if False:"),
    ],
    ("fem/_terms.py", "fem/test_divide.py"): [
        ("parts of calibrated terms", "terms.with_factors(self.factors[origin])", "terms"),
    ],
    ("studies/_evidence.py", "studies/test_identify.py"): [
        ("probability of the bounds", "logs = logs + logsumexp(", "logs = logs + 0 * logsumexp("),
        ("exact effects of several causes", "self.rotation\n        added", "0 * self.rotation\n        added"),
    ],
    ("studies/_simulation.py", "studies/test_study.py"): [
        (
            "noise of reference records",
            "self.reference(scenario, int(seeds[1]))",
            "self.reference(scenario, int(seeds[0]))",
        ),
    ],
    ("studies/_rates.py", "studies/test_ranking.py"): [
        ("Bonferroni in the ranking", "/ 2 / max(n_comparisons, 1)", "/ 2"),
        ("a threshold moved on all repeats", "pod_of(others, known, limit)", "pod_of(others, calibration, limit)"),
    ],
    ("studies/_task.py", "studies/test_detection_task.py"): [
        ("a threshold lowered to the limit", "+ 1e-9)], 0.0))", "+ 1e-9)], np.inf))"),
        ("windows that reach into other states", "np.flatnonzero(np.diff(repeat) | np.diff(scenario)) + 1", "[]"),
        ("false alarms that pay", 'limit / max(self.false_alarms()["ci_low"], limit)', "1.0"),
        (
            "records that are not evaluated",
            "np.where(np.isnan(self.values), 0.0,",
            "np.where(np.isnan(self.values), -1.0,",
        ),
        ("fresh noise that is that of the task", "random_state)[:, 1]", "random_state)[:, 0]"),
        ("a search whose best learns all records", "clone(detector).fit(self.baseline)", "clone(detector).fit(self.X)"),
    ],
    ("surrogate/_records.py", "surrogate/test_service_records.py"): [
        ("gaps in any weather", 'kind="stable")[:25]', 'kind="stable")'),
    ],
    ("studies/_rates.py", "studies/test_pod_curve.py"): [
        ("length of the blocks of a rate", "length: int = 10", "length: int = 1"),
    ],
    ("metrics/_detectability.py", "metrics/test_metrics.py"): [
        ("first alarm", "np.flatnonzero(index[first:] > limit)", "np.flatnonzero(index[first:] >= limit)"),
    ],
    ("plotting/_over_time.py", "plotting/test_limits.py"): [
        ("outliers that nobody counts", "        if far:", "        if is_upper:"),
    ],
    ("plotting/_studies.py", "plotting/test_detectors.py"): [
        ("measured rates outside their bands", '(rates["mark"] < rates["low"]) |', '(rates["mark"] < rates["low"]) &'),
        ("measured records not evaluated", '{"unknown_measured": "", ', "{"),
    ],
    ("monitoring/_status.py", "reporting/test_service.py"): [
        ("silence called healthy", "self.max_age is not None and self.age > self.max_age", "False"),
    ],
    ("reporting/_monitor.py", "reporting/test_service.py"): [
        ("much lost stiffness called healthy", 'return "attention" if said == "healthy" and self.worn else', "return"),
    ],
    ("reporting/_fleet.py", "reporting/test_fleet.py"): [
        ("significant alarms among the others", '"significant" if is_significant else "open"', '"open"'),
        ("silent bridges below healthy ones", '"not evaluated": ("silent",', '"not evaluated": ("well",'),
    ],
    ("reporting/_study.py", "reporting/test_choice.py"): [
        ("alarm system that is recommended", "ranking.index[0] if", "ranking.index[1] if"),
    ],
    ("plotting/_structures.py", "plotting/test_structures.py"): [
        ("motions out of the plane", "and moving <= {*plane", "or moving <= {*plane"),
    ],
    ("monitoring/_files.py", "monitoring/test_files.py"): [
        ("functions read from files", "isinstance(found, type) and found", "found"),
        ("classes of other packages by a trusted name", "and found.__module__ == module", ""),
    ],
    ("commands/_bridge.py", "commands/test_monitor_commands.py"): [
        ("an alarm that has ended within a batch", "if had_alarm or self.state", "if self.state"),
    ],
    ("_core/files.py", "test_shared_files.py"): [
        ("a lock that another process holds", "        return False\n    return True", "        pass\n    return True"),
    ],
}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("words", nargs="*", metavar="WORD", help="only mutations with one of these in what they break")
    parser.add_argument("--jobs", type=int, default=2, help="how many run at a time")
    options = parser.parse_args()
    chosen = [
        (*where, *mutation)
        for where, mutations in MUTATIONS.items()
        for mutation in mutations
        if not options.words or any(word in mutation[0] for word in options.words)
    ]
    unwritable = [mutation for mutation in chosen if not is_written_once(*mutation)]
    if unwritable or not chosen:
        print("no mutation has these words" if not chosen else "expected once in its file:", *unwritable, sep="\n")
        return 2
    copies = queue.SimpleQueue()  # of the package, one for each job

    def outcome(mutation):
        copy = copies.get()
        try:
            return survives(copy, *mutation)
        finally:
            copies.put(copy)

    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(options.jobs) as pool:
        for job in range(options.jobs):
            copies.put(copied_to(Path(folder) / str(job)))
        survived = [mutation for mutation, alive in zip(chosen, pool.map(outcome, chosen), strict=True) if alive]
    print(f"{len(chosen) - len(survived)} of {len(chosen)} killed")
    for file, tests, breaks, *_ in survived:
        print(f"SURVIVED: {breaks} ({file}; tests/{tests})")
    return 1 if survived else 0


def is_written_once(file, tests, breaks, original, mutated):
    """Whether a mutation can be made: its file and tests exist, and its text stands in the file once."""
    path = ROOT / "skthermo" / file
    return path.exists() and path.read_text().count(original) == 1 and (ROOT / "tests" / tests).exists()


def copied_to(folder):
    """A folder with a copy of all that tests need."""
    folder.mkdir()
    for name in COPIED:
        copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
        copy(ROOT / name, folder / name)
    return folder


def survives(folder, file, tests, breaks, original, mutated):
    """Whether the tests pass in spite of a mutation."""
    path = folder / "skthermo" / file
    source = path.read_text()
    path.write_text(source.replace(original, mutated))
    start = time.perf_counter()
    command = [sys.executable, "-B", "-m", "pytest", "-n0", "-q", "-x", f"tests/{tests}"]
    paths = os.environ | {"PYTHONPATH": str(folder)}
    run = subprocess.run(command, cwd=folder, env=paths, capture_output=True, text=True)
    path.write_text(source)
    if run.returncode not in (0, 1):
        raise RuntimeError(f"{tests} did not run:\n{run.stdout}{run.stderr}")
    verdict = "killed" if run.returncode else "SURVIVED"
    print(f"{verdict:9} {time.perf_counter() - start:4.0f} s  {breaks}", flush=True)
    return not run.returncode


if __name__ == "__main__":
    sys.exit(main())
