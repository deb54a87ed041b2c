"""What benchmarks use that is not public, in one place; imported once a benchmark asks for it."""

import importlib

PLACES = {
    "datasets._fleet_site": ["Law", "SiteClimate", "drawn_by_hour", "part_temperature", "persistent", "stream"],
    "datasets._kw51_campaign": ["memory"],
    "fem.external._files": ["form_of", "read_file"],
    "monitoring._fleet": ["KnownBridge"],
    "monitoring._events": ["EventLevels", "find_events", "followed"],
    "monitoring._retraining": ["begun_again", "retrained"],
    "monitoring._sensors": ["SensorWatch"],
    "monitoring._threshold": ["estimate_false_alarms"],
    "preprocessing.checks._record_findings": ["ASIDE_REASONS"],
}


def __getattr__(name):
    for place, names in PLACES.items():
        if name in names:
            return getattr(importlib.import_module(f"skthermo.{place}"), name)
    raise AttributeError(name)
