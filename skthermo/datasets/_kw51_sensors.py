"""Where the accelerometers of the railway bridge KW51 are in its FE model."""

from skthermo.datasets._kw51_structure import N_PANELS, kw51_structure

SIDES = {"A": 0, "C": N_PANELS}
DECK = ("aBD11Az", "aBD17Ay", "aBD17Az", "aBD17Cz", "aBD23Ay", "aBD23Az")
ARCH = {"aAR0910": 10, "aAR1516": 16, "aAR2122": 22}
"""Stations of the arch."""


def kw51_sensors() -> dict[str, int]:
    """Degrees of freedom of the FE model at the accelerometers of the railway bridge KW51.

    Returns
    -------
    dict of str to int
        Label of each of the 12 sensors, in the order of the monitoring data, and its degree of freedom in
        `make_kw51`.

    See Also
    --------
    kw51_structure : The structure, whose ``dofs`` these are.

    Notes
    -----
    The positions are read from the labels, and assumed where these leave them open. On the deck, the number is that of
    the transverse beam, 1 to 33 (17 is mid-span), so that the station is the number less 1; the letter A or C is the
    side, and y or z the direction. On the arch, the numbers 9 and 10, 15 and 16, 21 and 22 lie about a middle of 15.5
    as the deck's numbers 11, 17 and 23 about theirs: the sensors are taken as those above them, at stations 10, 16
    and 22. Side A is the line 0 of the model (y = -6.2 m), and every sensor counts as positive along the model's axes.
    Check these assumptions by the MAC of measured and computed shapes (`~skthermo.fem.match_modes`).
    For `load_kw51`, ``[kw51_sensors()[name] for name in data.sensors]`` are the degrees of freedom of the last axis of
    ``shapes``.

    Examples
    --------
    >>> from skthermo.datasets import kw51_sensors, kw51_structure
    >>> sensors = kw51_sensors()
    >>> list(sensors)[:3]
    ['aBD11Az', 'aBD17Ay', 'aBD17Az']
    >>> kw51_structure().dofs[sensors["aBD17Az"]]
    (('deck', 16, 0), 'z')
    """
    places = {label: (("deck", int(label[3:5]) - 1, SIDES[label[5]]), label[6]) for label in DECK}
    for pair, station in ARCH.items():
        places |= {f"{pair}{side}y": (("arch", station, line), "y") for side, line in SIDES.items()}
    dofs = {dof: i for i, dof in enumerate(kw51_structure().dofs)}
    return {label: dofs[place] for label, place in places.items()}
