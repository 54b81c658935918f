"""The Python lines of docs/data.md run as they are written, on a small export in the place of the one that it makes."""

import re
from pathlib import Path

import pytest
from recorded import scripted

from tstar_rl.demonstrations.formats import read_demonstrations, write_hdf5, write_minari

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.slow
def test_the_lines_of_the_page(tmp_path, monkeypatch, capsys):
    pytest.importorskip("minari")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv(
        "MINARI_DATASETS_PATH", "exports/minari"
    )  # one of the blocks sets it: this puts it back
    found = scripted(task="table_lack", subtask=0)
    write_hdf5(found, "exports/table_lack/noisy_seed0/subtask0.hdf5")
    write_minari(found, "tstar/table_lack/subtask0_noisy_seed0-v0", "exports/minari")
    blocks = re.findall(
        r"^```python\n(.*?)^```", (ROOT / "docs/data.md").read_text(), re.MULTILINE | re.DOTALL
    )
    assert len(blocks) == 4
    told = []
    for block in blocks:
        exec(compile(block, "docs/data.md", "exec"), {})
        told.append(capsys.readouterr().out)
    assert told[0] == "{}\n"
    assert f"({len(found.episodes[0])}, 9)" in told[2]
    assert len(read_demonstrations("mine/subtask0.hdf5", "table_lack", 0)) >= 80
