"""make_modes.py: what it refuses, what it prints, what it leaves behind."""
import make_modes
import pytest
from fem import validate

# Attachment modes bend a boom over about its own depth, so that coarse elements have to be short at the ends.
COARSE_BOOM = ["--mesh", "20", "2", "2", "--end-refinement", "0.6", "--modes", "4"]


def refused(arguments, capsys):
    status = make_modes.main(arguments)
    captured = capsys.readouterr()
    assert captured.out == ""
    return status, captured.err


@pytest.mark.parametrize("change, key", [
    ("length = -1.0", "body.length"),
    ("length = inf", "body.length"),
    ("kind = 'shell'", "body.kind"),
    ("mesh = [4, 2]", "body.mesh"),
    ("mesh = [4, 2, 0]", "body.mesh"),
    ("modes = 0", "body.modes"),
    ("modes = 100000", "body.modes"),
    ("boundary = 'pinned'", "body.boundary"),
    ("damping_ratio = 1.5", "body.damping_ratio"),
    ("end_refinement = 1.0", "body.end_refinement"),
    ("title = ''", "body.title"),
    ("colour = 'red'", "body.colour"),
    ("material = { young_modulus = 1e9, poisson_ratio = 0.6, density = 1.0 }", "body.material.poisson_ratio"),
    ("material = { young_modulus = 1e9, poisson_ratio = 0.3 }", "body.material.density"),
    ("interfaces = { root = {} }", "body.interfaces.root"),
    ("interfaces = { outboard = { width = 0.3 } }", "body.interfaces.outboard.width"),
    ("interfaces = {}", "body.interfaces"),
    ("like = 'nobody'", "body.like"),
])
def test_a_parameter_that_cannot_be_used_is_refused_with_status_2_naming_the_key(change, key, tables, tmp_path, capsys):
    panel = {"kind": "'panel'", "title": "'a panel'", "length": "2.0", "width": "1.0", "thickness": "0.02",
             "material": "{ young_modulus = 1e9, poisson_ratio = 0.3, density = 250.0 }", "mesh": "[4, 4, 1]",
             "boundary": "'cantilever'", "modes": "3", "damping_ratio": "0.0", "interfaces": "{ outboard = {} }"}
    name, value = change.split(" = ", 1)
    panel[name] = value
    path = tmp_path / "bodies.toml"
    path.write_text("[body]\n" + "\n".join(f"{name} = {value}" for name, value in panel.items()))
    status, message = refused(["--parameters", str(path), "--out", str(tmp_path)], capsys)
    assert status == 2
    assert f"{key}:" in message
    assert list(tmp_path.glob("*.h5*")) == []


def test_a_missing_key_an_unknown_body_and_a_missing_file_are_refused_by_name(modes_folder, bodies, tmp_path, capsys):
    path = tmp_path / "bodies.toml"
    path.write_text("[body]\nkind = 'boom'\n")
    assert refused(["--parameters", str(path)], capsys)[1].startswith("make_modes.py: body.thickness: missing")
    status, message = refused(["nobody"], capsys)
    assert status == 2
    assert message == f"make_modes.py: nobody: no such body in {modes_folder / 'bodies.toml'}; it has {', '.join(bodies)}\n"
    status, message = refused(["--parameters", str(tmp_path / "absent.toml")], capsys)
    assert status == 2 and "absent.toml" in message


def test_an_override_that_cannot_be_used_is_refused_by_its_key(capsys):
    assert refused(["boom_cantilever", "--modes", "-1"], capsys) == (
        2, "make_modes.py: boom_cantilever.modes: expected an integer of at least 1, found -1\n")
    with pytest.raises(SystemExit) as stop:
        make_modes.main(["--element", "hex8"])
    assert stop.value.code == 2 and "--element" in capsys.readouterr().err


def test_a_sandwich_of_one_row_of_reduced_elements_is_refused(capsys):
    status, message = refused(["panel_sandwich", "--mesh", "4", "1", "3"], capsys)
    assert status == 2 and "panel_sandwich.mesh" in message and "zero-energy" in message


def test_a_file_that_breaks_a_rule_is_not_written_and_gives_status_1(tmp_path, capsys):
    # Thirty modes on eight elements: lumped and consistent mass no longer agree.
    status = make_modes.main(["panel_cantilever", "--mesh", "8", "4", "1", "--modes", "30", "--out", str(tmp_path)])
    assert status == 1
    assert "lumped orthonormality" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("boundary", ["cantilever", "craig-bampton", "free-free"])
def test_a_coarse_boom_is_made_in_every_mode_set_and_described(boundary, tmp_path, capsys):
    assert make_modes.main(["boom_cantilever", "--boundary", boundary, *COARSE_BOOM, "--out", str(tmp_path)]) == 0
    captured = capsys.readouterr()
    for words in ("mass 19.44 kg", "theory: Timoshenko beam", "interface tip: rbe3", "rules hold", "KiB"):
        assert words in captured.out
    assert sorted(path.name for path in tmp_path.iterdir()) == ["boom_cantilever.h5", "boom_cantilever.modes.xdmf", "boom_cantilever.xdmf"]
    assert all(rule.holds for rule in validate.validate(tmp_path / "boom_cantilever.h5"))


def test_the_list_names_every_body_and_makes_none(bodies, tmp_path, capsys):
    assert make_modes.main(["--list", "--out", str(tmp_path)]) == 0
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()] == list(bodies)
    assert list(tmp_path.iterdir()) == []


def test_the_committed_page_is_what_the_files_say(modes_folder, tmp_path, bodies):
    for name in bodies:
        (tmp_path / f"{name}.h5").symlink_to(modes_folder / f"{name}.h5")
    assert make_modes.main(["--readme", "--out", str(tmp_path)]) == 0
    assert (tmp_path / "README.md").read_text() == (modes_folder / "README.md").read_text()
