"""Files of a synthetic bridge that a newcomer tries the commands on."""

import pandas as pd
import pytest

from tests.commands.folders import edit, run


@pytest.mark.usefixtures("one_detector")
def test_the_files_follow_each_other_and_the_other_commands_take_them(tmp_path):
    folder = tmp_path / "trial"
    done = run("demo", folder)
    assert done.code == 0
    assert str(folder / "T.csv") in done.out
    T, F, new, damaged = (
        pd.read_csv(folder / f"{name}.csv", index_col=0, parse_dates=True) for name in ("T", "F", "new", "damaged")
    )
    assert T.index.equals(F.index)
    assert list(new) == list(damaged) == [*T, *F]
    stamps = T.index.append([new.index, damaged.index])
    assert (stamps[1:] - stamps[:-1] == pd.Timedelta(hours=3)).all()
    assert pd.Timedelta(0) <= pd.Timestamp.now("UTC") - stamps[-1] < pd.Timedelta(hours=7)
    assert (damaged[list(F)].median() / new[list(F)].median() - 1).max() < 0

    assert run("init", folder / "T.csv", folder / "F.csv", "--into", folder / "bridge").code == 0
    edit(folder / "bridge" / "monitor.toml", "# until = ...", f'until = "{T.index[240].isoformat()}"')  # enough to fit
    assert run("fit", folder / "bridge").code == 0
