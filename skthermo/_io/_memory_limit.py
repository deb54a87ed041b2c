"""A bound on the memory that reading a file takes."""

LEAST = 256_000_000
TIMES_THE_FILE = 10
BYTES_FOR_EACH_ROW = 100
"""What the checks of a sparse matrix take for each row and column, entries apart."""


class MemoryLimit:
    """Ten times the size of a file, or 256 MB if that is more.

    Parameters
    ----------
    file_size : int
        In bytes; of several files, all together.
    """

    def __init__(self, file_size: int):
        self.limit = max(TIMES_THE_FILE * file_size, LEAST)
        self._kept = file_size

    def take(self, kept: int, passing: int = 0) -> None:
        """Count bytes that stay, and those that are needed for a moment.

        Raises
        ------
        ValueError
            If that is more than the limit.
        """
        if self._kept + kept + passing > self.limit:
            raise ValueError(
                f"it would take {(self._kept + kept + passing) / 1e6:.0f} MB of memory; expected at most "
                f"{self.limit / 1e6:.0f} MB, {TIMES_THE_FILE} times the size of the file or {LEAST / 1e6:.0f} MB "
                "(a sound file that is packed tightly can be saved without compression)"
            )
        self._kept += kept

    def take_sparse(self, n_rows: int, n_columns: int, n_entries: int, value_size: int = 8) -> None:
        """Count a sparse matrix: values, row numbers and where columns start."""
        self.take(
            n_entries * (value_size + 4) + 8 * (n_columns + 1),
            n_entries * (value_size + 16) + BYTES_FOR_EACH_ROW * (n_rows + n_columns),
        )
