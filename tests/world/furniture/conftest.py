"""A furniture file that tests change."""

import copy
from pathlib import Path

import pytest
import yaml

from tstar_envs.furniture import library

TABLE = yaml.safe_load((library.DATA / "table_lack.yaml").read_text())


@pytest.fixture
def table(tmp_path):
    """Returns a function that changes the table's file and gives its path."""

    def changed(change=lambda data: None) -> Path:
        data = copy.deepcopy(TABLE)
        change(data)
        path = tmp_path / "my_table.yaml"
        path.write_text(yaml.safe_dump(data, sort_keys=False))
        return path

    return changed
