"""Categories of warnings, for Python's filters."""

__all__ = [
    "FewRecordsWarning",
    "ModelWarning",
    "RecordsWarning",
    "ResultWarning",
    "SkthermoWarning",
    "UnevaluatedRowsWarning",
    "WeatherWarning",
]


class SkthermoWarning(UserWarning):
    """Any warning of skthermo.

    Parameters
    ----------
    message : str, default=""
        Text of the warning.
    kind : str, default=""
        Code of what the warning is about, such as "few-records". The text ends with it in brackets; the guide's page on
        warnings has an entry of this name.

    Examples
    --------
    >>> import warnings
    >>> from skthermo.exceptions import SkthermoWarning
    >>> warnings.filterwarnings("error", category=SkthermoWarning)  # to stop a script at the first one
    >>> warnings.filterwarnings("default", category=SkthermoWarning)
    """

    def __init__(self, message: str = "", kind: str = ""):
        super().__init__(message)
        self.kind = kind

    def __str__(self) -> str:
        return f"{super().__str__()} [{self.kind}]" if self.kind else super().__str__()


class RecordsWarning(SkthermoWarning):
    """Records that look wrong, such as numbers in place of missing values, sensors that are stuck, exchanged modes."""


class FewRecordsWarning(SkthermoWarning):
    """Fewer records than what is asked for needs: rows to train, records before the first for lags."""


class WeatherWarning(SkthermoWarning):
    """Weather, or a season, that the training records have not seen."""


class UnevaluatedRowsWarning(SkthermoWarning):
    """Rows or poles that are left out or NaN, because they lack what their evaluation needs."""


class ModelWarning(SkthermoWarning):
    """An FE model, its parameters or its modes that are doubtful, or calculations with it that failed."""


class ResultWarning(SkthermoWarning):
    """A result that is doubtful although its records and the model are not, or of something else than one may think."""
