"""Kinds of findings: what each one means for a result, and what to do."""

from __future__ import annotations

from collections.abc import Hashable
from typing import NamedTuple

MEANINGLESS, DOUBTFUL = "meaningless", "doubtful"

WARNINGS = {
    "no-table": "what is given is no table of numbers: {}. Nothing can be learned from it. Give a DataFrame or a "
    "two-dimensional array of numbers, a row for each record",
    "no-numbers": "columns hold something other than numbers: {}. Nothing can be learned from them. Convert or drop "
    "these columns",
    "column-names": "column names are ambiguous: {}. Columns are matched by name, so that one would be read as "
    "another. Give every column a name of its own, one text each",
    "different-rows": "the tables have different rows: {}. Frequencies would be compared with the temperatures of "
    "other times. Join the tables by their times",
    "no-rows": "there are too few records: {}. Nothing can be learned from them. Give the records of a year, or at "
    "least of weeks",
    "few-rows": "there are few records: {}. Outliers, shifts and trends cannot be distinguished from chance. Give the "
    "records of a year, or at least of weeks",
    "missing-stamps": "rows have no time: {}. Their place among the others is unknown. Drop these rows, or give their "
    "times",
    "equal-stamps": "all rows have the same time: {}. Order and duration of the records are unknown. Give each row "
    "its own time",
    "stamps-from-numbers": "times come from numbers that were read in the wrong unit: {}. Days would count as "
    "fractions of a second. Convert them by pandas.to_datetime with format= or unit=",
    "stamps-as-text": "the index holds times that are no DatetimeIndex: {}. Rows would count as equally spaced, in "
    "the given order. Convert the index by pandas.to_datetime",
    "repeated-stamps": "times occur more than once: {}. Lags and memory cannot know which of the rows was earlier. "
    "Keep one row for each time, such as by groupby(level=0).mean()",
    "unsorted-stamps": "rows are not in order of time: {}. Folds and lags take rows for periods of time. Sort them by "
    "sort_index()",
    "missing-column": "a column has no value: {}. Nothing can be learned from it. Leave it out, or check why it is "
    "empty",
    "infinite-values": "values are infinite or too large to be squared: {}. They count as missing. Put NaN there",
    "placeholders": "values stand for missing ones: {}. They count as missing. Put NaN there",
    "isolated-level": "values far from all others repeat exactly: {}. They count as missing. Put NaN there",
    "another-level": "values are far from all others: {}. They count as missing. Put NaN there",
    "implausible-values": "values are implausible: {}. They count as missing. Put NaN there",
    "constant": "a column is constant: {}. It carries no information, and its spread of zero makes any change "
    "infinite. Leave it out",
    "few-values": "a column has very few different values: {}. Its resolution hides the effect of the weather. Check "
    "rounding and the settings of the logger",
    "equal-columns": "columns are equal: {}. One channel counts twice, and another is missing. Keep one of them, and "
    "check where the other was read from",
    "not-positive": "frequencies are zero or negative: {}. They count as missing. Put NaN where a mode was not "
    "identified",
    "kelvin": "temperatures look like kelvin: {}. Bounds and reports are in degrees Celsius. Subtract 273.15",
    "fahrenheit": "temperatures look like degrees Fahrenheit: {}. Frost and reports would be wrong by many degrees. "
    "Convert them by (T - 32) / 1.8",
    "scaled-temperatures": "temperatures look like fractions of a degree: {}. Frost and reports would be wrong by "
    "that factor. Divide them by the factor",
    "opposite-signs": "a sensor falls where the others rise: {}. Means of the sensors would cancel, and its summer "
    "would count as frost. Check its sign",
    "exchanged-tables": "temperatures and frequencies look exchanged: {}. Temperatures would be predicted from "
    "frequencies. Exchange the two tables",
    "temperatures-are-frequencies": "a column stands in both tables: {}. The frequency would predict itself and hide "
    "all damage. Give temperatures only in the first table",
    "number-of-modes": "frequencies and model have different numbers of modes: {}. A column would be read as another "
    "mode. Give a column for each mode of the model, or the model with_modes of the columns",
    "unit-of-frequencies": "frequencies are in another unit than the model's: {}. Changes of the frequencies would be "
    "wrong by that factor. Convert them to Hz",
    "unit-of-a-mode": "a mode is far from the model's: {}. Its changes would be read as those of another mode or "
    "unit. Convert it to Hz, or order the columns as the model's modes",
    "stuck-sensor": "values of a sensor only repeat: {}. They count as missing. Put NaN where it is stuck",
    "stuck-mode": "values of a mode only repeat: {}. They count as missing. Put NaN where it is stuck",
    "no-thermal-effect": "the temperatures explain nothing of the frequencies: {}. Nothing can be compensated by "
    "them. Check whether the rows of both tables belong together",
    "time-shift": "temperatures of other rows explain the frequencies better: {}. The weather of another time would "
    "be learned. Join the tables by their times",
    "exchanged-modes": "modes look exchanged in some rows: {}. The scatter of both would hide damage. Exchange them "
    "back, or track modes by shape",
    "frequency-outliers": "frequencies are far from their neighbours in time and from what the weather explains: {}. "
    "They widen the spread of a baseline. Put NaN where a value is wrong, as HampelFilter does",
    "thermal-memory": "frequencies follow the weather of weeks, as soil and large concrete do: {}. Seasons would be "
    "taken for changes of the structure. Append these means to the inputs of the regression",
    "sudden-change": "frequencies change at once by what the weather does not explain: {}. Both levels would be "
    "learned as healthy. Fit on records of one structure, in one state and by one way of identification",
    "trend": "what the weather leaves of the frequencies has a trend: {}. A detector takes a trend that goes on for "
    "damage. Check whether the structure or a sensor drifts",
}
"""By kind: what was found, with a place for details; what follows from it; what to do."""

ARE_MEANINGLESS = frozenset(
    {
        *("no-table", "no-numbers", "column-names", "different-rows", "no-rows", "missing-stamps", "equal-stamps"),
        *("stamps-from-numbers", "missing-column", "constant", "kelvin", "exchanged-tables", "number-of-modes"),
        *("temperatures-are-frequencies", "unit-of-frequencies"),
    }
)
"""Kinds with which no result of a fit means anything."""

SET_ASIDE = frozenset(
    {
        *("infinite-values", "placeholders", "isolated-level", "another-level", "implausible-values", "not-positive"),
        *("stuck-sensor", "stuck-mode"),
    }
)
"""Kinds of values that cannot be, which count as missing."""

IMPOSSIBLE = frozenset({"infinite-values", "placeholders", "not-positive"})
"""Those which cannot be in any state of a structure."""

LEFT_OUT = frozenset({"missing-column", "constant"})
"""Kinds of columns that say nothing."""


class Finding(NamedTuple):
    """What was found in a column, in how many rows, from which row to which, and a sentence that says more."""

    what: str
    column: Hashable
    n_rows: int
    first: Hashable
    last: Hashable
    detail: str

    @property
    def severity(self) -> str:
        """ "meaningless" if results of a fit would be, else "doubtful"."""
        return MEANINGLESS if self.what in ARE_MEANINGLESS else DOUBTFUL

    @property
    def consequence(self) -> str:
        """What follows if the records are used as they are."""
        return WARNINGS[self.what].split(". ")[1]

    @property
    def action(self) -> str:
        """What to do."""
        return WARNINGS[self.what].split(". ")[2]
