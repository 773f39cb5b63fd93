"""Studies, beside the program's own, and plots."""

import conftest
import pytest

import heba

SCENE = """
setup: eye_to_hand
target: {type: chessboard, rows: 3, columns: 4, square: 30 mm}
camera: {model: pinhole, image_size: [640, 480], fx: 600, fy: 600, cx: 320, cy: 240}
hand_eye: {translation: [1050 mm, 50 mm, 400 mm], rpy: [-88 deg, 3 deg, 91 deg]}
board: {translation: [50 mm, -30 mm, 60 mm], rpy: [178 deg, 3 deg, 20 deg]}
motion: {captures: 6, distance: 500 mm, tilt: 25 deg}
"""


@pytest.fixture(scope="module")
def study_config(tmp_path_factory):
    folder = tmp_path_factory.mktemp("study")
    (folder / "scene.yaml").write_text(SCENE)
    config = folder / "study.yaml"
    config.write_text("trials: 3\nscenes: {small: scene.yaml}\npixel_noise: [0.1 px, 0.5 px]\n")
    return config


def test_study_is_that_of_the_program(study_config, tmp_path):
    study = heba.study(study_config, out=tmp_path / "by_python")
    conftest.program("study", study_config, "--out", tmp_path / "by_program", "--quiet")
    for name in ("study.csv", "study.txt", "config.yaml"):
        assert (tmp_path / "by_python" / name).read_bytes() == (tmp_path / "by_program" / name).read_bytes()
    assert (tmp_path / "by_python" / "study.html").exists()
    assert study.table == (tmp_path / "by_program" / "study.txt").read_text()
    bundle = [row for row in study.rows if row["method"] == "bundle"]
    assert [row["pixel_noise_px"] for row in bundle] == [0.1, 0.5]
    assert all(row["hand_eye_mm"] > 0 and row["trials"] == 3 for row in bundle)


def test_study_without_a_folder_writes_nothing(study_config, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    rows = heba.study(
        {"trials": 2, "scenes": {"small": str(study_config.parent / "scene.yaml")}, "pixel_noise": ["0.1 px"]}
    ).rows
    assert rows and not list(tmp_path.iterdir())
    with pytest.raises(heba.Error, match="trails"):
        heba.study({"trails": 2, "scenes": {"small": str(study_config.parent / "scene.yaml")}})


def test_plots_show_what_they_name(program_run, study_config):
    matplotlib = pytest.importorskip("matplotlib", reason="matplotlib is not there: no plot is drawn")
    matplotlib.use("Agg")
    result = heba.Result.read(program_run)
    axes = result.plot()
    used = [capture for capture in result.data["captures"] if capture["used"]]
    assert [bar.get_height() for bar in axes.patches] == [capture["holdout_target_mm"] for capture in used]
    assert [label.get_text() for label in axes.get_xticklabels()] == [capture["image"] for capture in used]
    plan = heba.plan(program_run, 3)
    assert len(plan.plot().texts) == len(plan)
    study = heba.study(study_config)
    lines = {line.get_label(): line.get_ydata() for line in study.plot("pixel_noise_px", "hand_eye_mm").lines}
    expected = [row["hand_eye_mm"] for row in study.rows if row["method"] == "bundle"]
    assert [list(errors) for name, errors in lines.items() if name.endswith("bundle")] == [expected]


def test_plots_name_what_they_lack(program_run, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "matplotlib", None)
    with pytest.raises(ImportError, match="plots need matplotlib"):
        heba.Result.read(program_run).plot()
