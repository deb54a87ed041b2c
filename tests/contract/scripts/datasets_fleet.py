"""Bridges of a fleet: their kinds, and records of one with a softer soil."""

from skthermo.datasets import make_fleet

fleet = make_fleet(3, random_state=0)
bridge = fleet["bridge 001"]
records = bridge.records(60, damage={"soil": 0.2})
RESULTS = {
    "names": list(fleet),
    "parameters": list(bridge.model.parameter_names),
    "groups": list(bridge.groups),
    "shapes": [list(records.temperatures.shape), list(records.frequencies.shape)],
    "falls": bool(records.frequencies.mean().lt(bridge.records(60).frequencies.mean()).any()),
}
