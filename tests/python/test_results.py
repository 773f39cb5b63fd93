"""Comparisons of finished runs and printed sheets, beside what the program writes."""

import conftest
import pytest

import heba


def test_compare_gives_what_the_program_writes(cell, program_run, tmp_path):
    fewer = heba.run(
        cell / "config.yaml", out=tmp_path / "fewer", settings={"name": "fewer", "captures": {"exclude": ["000.png"]}}
    )
    comparison = heba.compare(program_run, fewer, out=tmp_path / "by_python")
    printed = conftest.program("compare", program_run, tmp_path / "fewer", "--out", tmp_path / "by_program")
    # The program breaks long lines.
    assert " ".join(printed.stdout.split()).startswith(" ".join(comparison.table.split()))
    files = {file.name for file in (tmp_path / "by_python").iterdir() if not file.name.startswith(".")}
    assert files == {"compare.csv", "pairs.csv", "compare.html"}
    for file in files:
        assert (tmp_path / "by_python" / file).read_bytes() == (tmp_path / "by_program" / file).read_bytes(), file
    assert [run["run"] for run in comparison.runs] == ["config", "fewer"]
    (pair,) = comparison.pairs
    assert 0 < pair["distance_mm"] < 1 and pair["verdict"] == "agree"
    with pytest.raises(heba.Error, match="runs: compare needs at least one run"):
        heba.compare()
    with pytest.raises(heba.Error, match="contains no run"):
        heba.compare(tmp_path / "by_python")


def test_target_writes_what_the_program_writes(tmp_path):
    keys = {"type": "charuco", "rows": 5, "columns": 7, "square": "24 mm", "marker": "18 mm", "dictionary": "DICT_4X4_50"}
    points = heba.target(keys, tmp_path / "by_python.svg", paper="a4")
    assert points == tmp_path / "by_python.json"
    spec = "{" + ", ".join(f"{key}: {value}" for key, value in keys.items()) + "}"
    conftest.program("target", spec, "--paper", "a4", "--out", tmp_path / "by_program.svg")
    assert (tmp_path / "by_python.svg").read_bytes() == (tmp_path / "by_program.svg").read_bytes()
    (tmp_path / "board.yaml").write_text("{type: chessboard, rows: 7, columns: 9, square: 25 mm}")
    with pytest.warns(UserWarning, match="looks the same after a rotation by 180 deg"):
        heba.target(tmp_path / "board.yaml", tmp_path / "board.pdf")
    for arguments, words in [
        (({**keys, "row": 5}, tmp_path / "no.svg"), "unknown key 'row'"),
        ((keys, tmp_path / "no.txt"), "no.txt"),
    ]:
        with pytest.raises(heba.Error, match=words):
            heba.target(*arguments)
    with pytest.raises(heba.Error, match="paper: .*did you mean 'a4'"):
        heba.target(keys, tmp_path / "no.svg", paper="A4 ")
