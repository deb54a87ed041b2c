"""Share of right assignments of ModeTracker, on simulated poles whose modes are known.

    OMP_NUM_THREADS=1 python tests/benchmarks/mode_tracker.py

A cell is a record and a mode. It is right if the mode's true pole is assigned, or none where the mode is missing.

Eight modes of random real shapes vary by up to 5 % with a year's temperature, and two of them cross. A fifth of the
modes is missing in each record, and 40 % of all poles are spurious: at random frequencies, with shapes that are random
sums of those of all modes, or of the two nearest. Shape noise is complex, and relative to the root mean square of a
shape's components. The last lines are for modes of the FE model of Z24, which swap order.
"""

import numpy as np
import pandas as pd

from skthermo.datasets import make_z24
from skthermo.preprocessing import ModeTracker

FREQUENCIES = np.array([1.2, 1.9, 2.45, 2.57, 2.9, 3.9, 4.06, 5.4])
SLOPES = np.array([-0.02, 0.02, 0.035, -0.035, -0.05, 0.01, -0.01, 0.03])  # relative, from the mean to the extreme


def simulated_poles(n_records, n_sensors=12, shape_noise=0.15, *, spurious=0.4, missing=0.2, mixes=8, seed=0):
    """Ragged poles in the order of frequency, the pole of every mode (-1 where missing), and the reference.

    The shapes of spurious poles mix those of the nearest ``mixes`` modes.
    """
    random = np.random.default_rng(seed)
    n_modes = len(FREQUENCIES)
    shapes = random.normal(size=(n_sensors, n_modes))
    shapes /= np.sqrt((shapes**2).mean(axis=0))
    temperature = np.sin(2 * np.pi * np.arange(n_records) / n_records)
    true = FREQUENCIES * (1 + np.outer(temperature, SLOPES)) * random.normal(1, 0.002, (n_records, n_modes))
    records, poles = [], np.full((n_records, n_modes), -1)
    for i in range(n_records):
        present = np.flatnonzero(random.random(n_modes) >= missing)
        n_spurious = random.binomial(round(n_modes * (1 - missing) / (1 - spurious)), spurious)
        f = np.append(true[i, present], random.uniform(0.9, 6.0, n_spurious))
        near = np.abs(f[len(present) :, np.newaxis] - FREQUENCIES).argsort().argsort() < mixes
        mixed = (complex_normal(random, (n_spurious, n_modes)) * near) @ shapes.T
        mixed /= np.sqrt((np.abs(mixed) ** 2).mean(axis=1, keepdims=True))
        phi = np.vstack([shapes.T[present], mixed])
        phi = (phi + shape_noise * complex_normal(random, phi.shape)) * complex_normal(random, (len(phi), 1))
        order = np.argsort(f)
        poles[i, present] = np.argsort(order)[: len(present)]
        records.append({"frequencies": f[order], "shapes": phi[order], "damping": np.full(len(f), 0.01)})
    return records, poles, (FREQUENCIES, shapes)


def z24_poles(n_records, n_sensors, shape_noise, seed=0):
    """Four modes of the FE model of Z24 in the order of frequency; stiffnesses are uniform within 30 %."""
    random = np.random.default_rng(seed)
    model = make_z24()
    theta = random.uniform(0.7, 1.3, (n_records, len(model.parameter_names)))
    (nominal, frequencies), (reference, phi) = (
        np.split(values, [1]) for values in model.modes(np.vstack([np.ones_like(theta[:1]), theta]))
    )
    moving = np.argsort(np.abs(reference[0]).max(axis=1))[-200:]
    sensors = random.choice(moving, n_sensors, replace=False)
    phi = phi[:, sensors] / np.sqrt((phi[:, sensors] ** 2).mean(axis=1, keepdims=True))
    phi = phi + shape_noise * complex_normal(random, phi.shape)
    order = np.argsort(frequencies, axis=1)
    records = [{"frequencies": f[o], "shapes": s.T[o]} for f, s, o in zip(frequencies, phi, order, strict=True)]
    return records, np.argsort(order, axis=1), (nominal[0], reference[0, sensors])


def complex_normal(random, size):
    return (random.normal(size=size) + 1j * random.normal(size=size)) / np.sqrt(2)


def by_sorting(records, n_modes=8):
    """The lowest poles of each record, in their order, as the modes."""
    ranks = np.arange(n_modes)
    return np.array([np.where(ranks < len(record["frequencies"]), ranks, -1) for record in records])


def right(poles, true):
    """Percent of cells that are right."""
    return 100 * (np.asarray(poles) == true).mean()


def ways(records, reference, max_shift):
    alone = [{"frequencies": record["frequencies"]} for record in records]
    tracker = ModeTracker(reference, max_shift=max_shift)
    return {
        "shapes": tracker.fit_transform(records).poles,
        "frequency": ModeTracker((reference[0], None), max_shift=max_shift).fit_transform(alone).poles,
        "sorting": by_sorting(records),
    }


def main():
    from harness import arguments, shown  # which tests that import this do not have

    n_records = arguments(__doc__, records=300).records
    rows = {}
    for n_sensors, noise, mixes in [
        (12, 0.3, 8),
        (12, 0.5, 8),
        (12, 0.15, 2),
        (6, 0.15, 8),
        (4, 0.15, 8),
        (3, 0.15, 8),
    ]:
        records, true, reference = simulated_poles(n_records, n_sensors, noise, mixes=mixes, seed=1)
        found = ways(records, reference, 0.15)
        if noise == 0.5:
            tracker = ModeTracker(reference, min_mac=0.6)
            found["shapes, min_mac=0.6"] = tracker.fit_transform(records).poles
        name = f"{n_sensors} sensors, shape noise {noise:.0%}{'' if mixes == 8 else ', spurious poles like two modes'}"
        rows[name] = {way: right(poles, true) for way, poles in found.items()}
    for n_sensors in (16, 5):
        records, true, reference = z24_poles(n_records, n_sensors, 0.2)
        found = {"shapes": ModeTracker(reference).fit_transform(records).poles, "sorting": by_sorting(records, 4)}
        name = f"FE model of Z24, {n_sensors} sensors, shape noise 20%"
        rows[name] = {way: right(poles, true) for way, poles in found.items()}
    shown(f"Modes with the right pole, %, of {n_records} records", pd.DataFrame(rows).T, 1)


if __name__ == "__main__":
    main()
