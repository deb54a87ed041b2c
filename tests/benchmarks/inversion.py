"""How exactly the inverse surrogate finds parameters, how well it knows its own errors, and how long it takes to train.

    OMP_NUM_THREADS=1 python tests/benchmarks/inversion.py

On the truss (box of 20 %) and on the bridge KW51 (box of 30 %) with modes followed by shape and sorted by frequency.
"""

import argparse
import time
import warnings

import numpy as np
import pandas as pd
from sklearn.linear_model import Ridge

from skthermo.datasets import kw51_structure, make_kw51, make_truss
from skthermo.fem import add_noise, evaluate, linearise, sample
from skthermo.surrogate import InverseSurrogate, paper_network
from skthermo.updating import cramer_rao

EXACT = 1e-5
NORMAL_90 = 1.645
FAR_DEVIATIONS = 4
FEW_ROWS = 0.1
"""Share of the rows with a Cramer-Rao deviation within the box up to which they are too few for a mean."""
MEMBERS = {"E_bot": "bottom", "E_arc": "arch", "E_br": "braces", "E_con": "connections", "E_pip": "pipes"}


def models():
    """FE models, and half-widths of their boxes."""
    by_rank = kw51_structure().assemble(MEMBERS, n_modes=6)
    return {
        "truss": (make_truss(), 0.2),
        "KW51, tracked": (make_kw51().reduced(0.3, random_state=0), 0.3),
        "KW51, sorted": (by_rank.reduced(0.3, random_state=0), 0.3),
    }


class Inversion:
    """Surrogates of one model, and fresh rows of parameters and frequencies to test them on."""

    def __init__(self, model, bounds, options):
        self.model, self.bounds, self.options = model, bounds, options
        self.test = sample(model, bounds, options.rows, random_state=1)
        self.names = list(model.parameter_names)

    def surrogate(self, regressor=None, **settings):
        """A surrogate, fitted."""
        settings = {"n_samples": self.options.simulations, "random_state": 0} | settings
        return InverseSurrogate(self.model, regressor, bounds=self.bounds, **settings).fit()

    def print_exactness(self):
        """Rows found exactly, rows that have not converged, and rows that converged elsewhere."""
        start = time.perf_counter()
        inverse = self.surrogate()
        fitted = time.perf_counter()
        found = inverse.invert(self.test.frequencies)
        seconds = time.perf_counter() - fitted
        exact = (np.abs(found.theta / self.test.theta - 1) < EXACT).all(axis=1)
        wrong = found.converged & ~exact
        fits = wrong & (np.sqrt((found.residuals**2).mean(axis=1)) < EXACT)
        print(f"rows with every parameter within 0.001 %, at least 99 %: {exact.mean():.1%}")
        print(f"rows counted as not converged: {(~found.converged).mean():.1%}")
        print(f"rows that converged to other parameters: {wrong.sum()} of {len(wrong)}; {fits.sum()} of them reproduce")
        print("  the frequencies to 0.001 %, so that frequencies alone cannot tell them from the true ones")
        print(f"training {fitted - start:.2f} s, prediction {1e3 * seconds / len(exact):.2f} ms a row")

    def print_calibration(self):
        """Errors against the Cramer-Rao deviation, and coverage of intervals, with noise and with gaps."""
        noise, random = self.options.noise, np.random.RandomState(2)
        inverse = self.surrogate(noise=noise)
        measured = add_noise(self.test.frequencies, noise, random_state=random)
        gappy = measured.copy()
        n_modes = measured.shape[1]
        for row in gappy:
            row[random.permutation(n_modes)[: n_modes // 2]] = np.nan
        table = {}
        for name, frequencies in (("complete", measured), ("half of the modes missing", gappy)):
            found = inverse.invert(frequencies)
            table |= {(name, title): values for title, values in self.accuracy(found, frequencies).items()}
            far = self.far(found)
            here, truth = (self.surprise(inverse, theta, frequencies) for theta in (found.theta, self.test.theta))
            missed = far & (here > truth)
            print(
                f"{name}: rows with a parameter off by more than {FAR_DEVIATIONS} reported deviations: "
                f"{far.sum()} of {len(far)};"
            )
            print(f"  in {missed.sum()} of them the true parameters are more probable than those found")
        print(pd.DataFrame(table, index=self.names).round(3).T.to_string(na_rep="-"))

    def far(self, found):
        """Which rows are off by many reported deviations in some parameter."""
        return (np.abs(found.theta - self.test.theta) > FAR_DEVIATIONS * found.std).any(axis=1)

    def surprise(self, inverse, theta, frequencies):
        """Minus the logarithm of the posterior density of each row of parameters, up to a constant."""
        prior = inverse.refinement_.prior
        misfits = np.log(frequencies / evaluate(self.model, theta)) / self.options.noise
        distances = (np.log(theta) - prior.mean) / prior.width
        return np.nansum(misfits**2, axis=1) / 2 + (distances**2).sum(axis=1) / 2

    def accuracy(self, found, frequencies):
        """Measures of accuracy by parameter."""
        deviations, far = self.cramer_rao_deviations(frequencies), self.far(found)
        errors = np.log(found.theta / self.test.theta)
        informed = pd.DataFrame(deviations < self.bounds)
        informed &= informed.mean() > FEW_ROWS
        typical = pd.DataFrame(deviations).where(informed).median()
        ratios = pd.DataFrame(errors / deviations).where(informed)
        reported = pd.DataFrame(errors * found.theta / found.std)
        held = np.abs(found.theta - self.test.theta) < NORMAL_90 * found.std
        return {
            "share of rows where the Cramer-Rao deviation is within the box": informed.mean().to_numpy(),
            "median of that deviation there, %": 100 * typical.to_numpy(),
            "rms error over that deviation, at most 1.2": rms(ratios),
            f"the same without rows off by more than {FAR_DEVIATIONS} reported deviations": rms(ratios[~far]),
            "rms error over the reported deviation": rms(reported),
            "coverage of 90 % intervals, 0.85 to 0.95": held.mean(axis=0),
            "share of rows that converged": np.full(len(self.names), found.converged.mean()),
        }

    def cramer_rao_deviations(self, frequencies):
        """Least deviations of ln theta at the true parameters, from the modes that are there."""
        nominal, jacobian = linearise(self.model, self.test.theta)
        slopes = jacobian * self.test.theta[:, np.newaxis] / nominal[:, :, np.newaxis] / self.options.noise
        slopes = np.where(np.isnan(frequencies)[:, :, np.newaxis], 0.0, slopes)
        return np.sqrt([np.diag(cramer_rao(row.T @ row)) for row in slopes])

    def print_time(self):
        """The paper's network of Table 4 against a linear guess from few simulations that is refined."""
        guesses = self.refined_guesses()
        print("a linear guess (ridge regression in logarithms) from few simulations, refined; without noise:")
        print(guesses.to_string(float_format=lambda value: f"{value:.3g}"))
        print(
            "the paper's network (Table 4) and its mean errors without noise; the paper's Table 5 has 0.02 to 0.03 %:"
        )
        epochs = self.options.epochs
        for title, settings in {
            f"until the loss stops falling, at most {epochs} epochs": {},
            f"all {epochs} epochs": {"n_iter_no_change": epochs},
        }.items():
            network = paper_network("kw51-inverse", max_iter=epochs, **settings)
            seconds, inverse = timed(lambda network=network: self.surrogate(network, refine=0))
            predicting, found = timed(lambda inverse=inverse: inverse.predict(self.test.frequencies))
            errors = 100 * np.abs(found / self.test.theta - 1).mean(axis=0)
            print(f"{title} ({inverse.regressor_.n_iter_} used): training {seconds:.1f} s, prediction ", end="")
            print(f"{1e3 * predicting / len(found):.3f} ms a row, mean error {errors.mean():.2f} %")
            print("  " + ", ".join(f"{name} {error:.2f} %" for name, error in zip(self.names, errors, strict=True)))
            good = guesses[guesses["mean error, %"] <= errors.mean()]
            if good.empty:
                print("  no refined guess is as accurate")
                continue
            (n_samples, refine), fastest = good["training, s"].idxmin(), good["training, s"].min()
            print(f"  as accurate: {n_samples} simulations and refine={refine}, trained in {fastest:.3f} s")
            print(f"  times less training, at least 100: {seconds / fastest:.0f}")

    def refined_guesses(self):
        """Errors and times by number of simulations and of steps."""
        rows = {
            (n_samples, refine or "default"): self.refined_guess(n_samples, refine)
            for n_samples in self.options.few
            for refine in (2, 3, 5, None)
        }
        table = pd.DataFrame(rows, ["mean error, %", "training, s", "prediction, ms a row", "converged"]).T
        table.index.names = ["simulations", "refine"]
        return table

    def refined_guess(self, n_samples, refine):
        """Mean error, median seconds of training over rounds, milliseconds a prediction, share of converged rows."""
        ways = [timed(lambda: self.surrogate(Ridge(1e-6), n_samples=n_samples, refine=refine)) for _ in range(5)]
        predicting, found = timed(lambda: ways[0][1].invert(self.test.frequencies))
        error = np.abs(found.theta / self.test.theta - 1).mean()
        training = np.median([seconds for seconds, _ in ways])
        return [100 * error, training, 1e3 * predicting / len(found.theta), found.converged.mean()]


def rms(values):
    """Root mean square of every column of a frame, without NaN."""
    return np.sqrt((values**2).mean()).to_numpy()


def timed(way):
    """Seconds that a call takes, and what it gives."""
    start = time.perf_counter()
    result = way()
    return time.perf_counter() - start, result


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--simulations", type=int, default=1000, help="training rows")
    parser.add_argument("--rows", type=int, default=1000, help="test rows")
    parser.add_argument("--noise", type=float, default=0.001, help="relative deviation of the noise of frequencies")
    parser.add_argument("--few", type=int, nargs="+", default=[10, 20, 50, 200], help="training rows of the guess")
    parser.add_argument("--epochs", type=int, default=1000, help="epochs of the paper's network")
    parser.add_argument("--models", nargs="+", default=["truss", "KW51, tracked", "KW51, sorted"])
    options = parser.parse_args()
    warnings.filterwarnings("ignore", r".*(did not converge|change their order|hasn't converged|was reduced)")
    chosen = {name: value for name, value in models().items() if name in options.models}
    for name, (model, bounds) in chosen.items():
        inversion = Inversion(model, bounds, options)
        print(f"\n{name}, box of {bounds:.0%}, {options.simulations} simulations, {options.rows} test rows")
        print("\nwithout noise")
        inversion.print_exactness()
        print(f"\nwith {options.noise:.1%} noise")
        inversion.print_calibration()
        if name == "KW51, tracked":
            print("\ntime")
            inversion.print_time()


if __name__ == "__main__":
    main()
