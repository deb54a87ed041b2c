import subprocess
from pathlib import Path
from tempfile import TemporaryDirectory

from skthermo.fem import probe, read_triplets

deck_of_cards = Path("bridge.inp").read_text()


def matrices(theta):
    with TemporaryDirectory() as folder:
        job = Path(folder, "bridge")
        cards = deck_of_cards.format(E_deck=30e9 * theta[0], E_arch=30e9 * theta[1])
        job.with_suffix(".inp").write_text(cards)
        subprocess.run(["ccx", job], check=True, capture_output=True)
        return read_triplets(job.with_suffix(".sti")), read_triplets(job.with_suffix(".mas"))


model = probe(matrices, ["E_deck", "E_arch"], n_modes=4)
