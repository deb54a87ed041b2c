"""Kinds of findings: what each one means for a result, and what to do."""

from __future__ import annotations

from collections.abc import Hashable
from typing import NamedTuple

MEANINGLESS, DOUBTFUL = "meaningless", "doubtful"

WARNINGS = {
    "no-table": "what is given is no table of numbers: {}; nothing can be learned from it; give a DataFrame or a "
    "two-dimensional array of numbers, a row for each record",
    "no-numbers": "columns hold something other than numbers: {}; nothing can be learned from them; convert or drop "
    "these columns",
    "column-names": "column names are ambiguous: {}; columns are matched by name, so that one would be read as "
    "another; give every column a name of its own, one text each",
    "different-rows": "the tables have different rows: {}; frequencies would be compared with the temperatures of "
    "other times; join the tables by their times",
    "no-rows": "there are too few records: {}; nothing can be learned from them; give the records of a year, or at "
    "least of weeks",
    "few-rows": "there are few records: {}; outliers, shifts and trends cannot be distinguished from chance; give the "
    "records of a year, or at least of weeks",
    "missing-stamps": "rows have no time: {}; their place among the others is unknown; drop these rows, or give their "
    "times",
    "equal-stamps": "all rows have the same time: {}; order and duration of the records are unknown; give each row "
    "its own time",
    "stamps-from-numbers": "times come from numbers that were read in the wrong unit: {}; days would count as "
    "fractions of a second; convert them by pandas.to_datetime with format= or unit=",
    "stamps-as-text": "the index holds times that are no DatetimeIndex: {}; rows would count as equally spaced, in "
    "the given order; convert the index by pandas.to_datetime",
    "repeated-stamps": "times occur more than once: {}; lags and memory cannot know which of the rows was earlier; "
    "keep one row for each time, such as by groupby(level=0).mean()",
    "unsorted-stamps": "rows are not in order of time: {}; folds and lags take rows for periods of time; sort them by "
    "sort_index()",
    "missing-column": "a column has no value: {}; nothing can be learned from it; drop the column, or look why it is "
    "empty",
    "infinite-values": "values are infinite or too large to be squared: {}; no mean and no spread can be calculated; "
    "put NaN there",
    "placeholders": "values stand for missing ones: {}; they would be learned as if they were measured; put NaN there",
    "isolated-level": "values far from all others repeat exactly: {}; they may stand for missing values, and would be "
    "learned as if they were measured; put NaN there if they do",
    "implausible-values": "values are implausible: {}; they widen every spread and so hide damage; put NaN where a "
    "value is wrong",
    "constant": "a column is constant: {}; it says nothing, and its spread of zero makes any change infinite; leave "
    "it out",
    "few-values": "a column has very few different values: {}; its resolution hides what the weather does; look at "
    "rounding and at the settings of the logger",
    "equal-columns": "columns are equal: {}; one counts twice, and the missing one not at all; keep one of them, and "
    "look whether the other was read from the right place",
    "not-positive": "frequencies are zero or negative: {}; no structure has them; put NaN where a mode was not "
    "identified",
    "kelvin": "temperatures look like kelvin: {}; bounds and reports are in degrees Celsius; subtract 273.15",
    "fahrenheit": "temperatures look like degrees Fahrenheit: {}; frost and reports would be wrong by many degrees; "
    "convert them by (T - 32) / 1.8",
    "scaled-temperatures": "temperatures look like fractions of a degree: {}; frost and reports would be wrong by "
    "that factor; divide them by the factor",
    "opposite-signs": "a sensor moves against the others: {}; means of the sensors would cancel, and its frost would "
    "be summer; look at its sign",
    "exchanged-tables": "temperatures and frequencies look exchanged: {}; temperatures would be predicted from "
    "frequencies; exchange the two tables",
    "temperatures-are-frequencies": "a column stands in both tables: {}; the frequency would predict itself and hide "
    "all damage; give temperatures only in the first table",
    "number-of-modes": "frequencies and model have different numbers of modes: {}; a column would be read as another "
    "mode; give a column for each mode of the model, or the model with_modes of the columns",
    "unit-of-frequencies": "frequencies are in another unit than the model's: {}; changes of the frequencies would be "
    "wrong by that factor; convert them to Hz",
    "unit-of-a-mode": "a mode is far from the model's: {}; its changes would be read as those of another mode or "
    "unit; convert it to Hz, or order the columns as the model's modes",
    "stuck-sensor": "values of a sensor only repeat: {}; the last value would be learned as weather; put NaN where it "
    "is stuck",
    "stuck-mode": "values of a mode only repeat: {}; the mode would seem to ignore the weather; put NaN where it is "
    "stuck",
    "no-thermal-effect": "the temperatures explain nothing of the frequencies: {}; nothing can be compensated by "
    "them; look whether the rows of both tables belong together",
    "time-shift": "temperatures of other rows explain the frequencies better: {}; the weather of another time would "
    "be learned; join the tables by their times",
    "exchanged-modes": "modes look exchanged in some rows: {}; the scatter of both would hide damage; exchange them "
    "back, or track modes by shape",
    "frequency-outliers": "frequencies are far from their neighbours in time and from what the weather explains: {}; "
    "they widen the spread of a baseline; put NaN where a value is wrong, as HampelFilter does",
    "thermal-memory": "frequencies follow the weather of weeks, as soil and large concrete do: {}; seasons would be "
    "taken for changes of the structure; append these means to the inputs of the regression",
    "sudden-change": "frequencies change at once by what the weather does not explain: {}; both levels would be "
    "learned as healthy; fit on records of one structure, in one state and by one way of identification",
    "trend": "what the weather leaves of the frequencies has a trend: {}; a detector takes a trend that goes on for "
    "damage; look whether the structure or a sensor drifts",
}
"""By kind: what was found, with a place for details; what follows from it; what to do."""

ARE_MEANINGLESS = frozenset(
    {
        *("no-table", "no-numbers", "column-names", "different-rows", "no-rows", "missing-stamps", "equal-stamps"),
        *(
            "stamps-from-numbers",
            "missing-column",
            "infinite-values",
            "placeholders",
            "constant",
            "not-positive",
            "kelvin",
        ),
        *("exchanged-tables", "temperatures-are-frequencies", "number-of-modes", "unit-of-frequencies"),
    }
)
"""Kinds with which no result of a fit means anything."""


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
        return WARNINGS[self.what].split("; ")[1]

    @property
    def action(self) -> str:
        """What to do."""
        return WARNINGS[self.what].split("; ")[2]
