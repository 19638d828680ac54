"""The rules of schema 1.0 on the committed files, and that the validator sees what is wrong with damaged ones."""
import shutil

import h5py
import numpy as np
import pytest

from fem import modal_file, validate


def test_every_committed_file_keeps_every_rule(name, modes_folder):
    rules = validate.validate(modes_folder / f"{name}.h5")
    assert len(rules) > 35, "a file whose structure is broken is left before its numbers are looked at"
    assert [str(rule) for rule in rules if not rule.holds] == []


def test_warnings_are_confined_to_the_lumped_mass_of_free_modes(name, bodies, modes_folder):
    # Attachment modes bend the panel over a few elements, where lumped and consistent mass differ by 3e-3; the tensors in use
    # come from the consistent mass.
    doubtful = [rule.name for rule in validate.validate(modes_folder / f"{name}.h5") if rule.doubtful]
    assert doubtful == (["lumped orthonormality"] if bodies[name].boundary == "free-free" else [])


def test_digest_does_not_depend_on_the_view_for_vtk(modes_folder, tmp_path):
    path = tmp_path / "copy.h5"
    shutil.copy(modes_folder / "boom_cantilever.h5", path)
    with h5py.File(path, "a") as file:
        before = file.attrs["content_sha256"].decode()
        del file["VTKHDF"]
        assert modal_file.digest(file) == before


def test_no_text_or_data_has_variable_length(name, modes_folder):
    def kinds(item):
        types = [item.attrs.get_id(key).dtype for key in item.attrs]
        return types + ([item.dtype] if isinstance(item, h5py.Dataset) else [])

    with h5py.File(modes_folder / f"{name}.h5") as file:
        found = kinds(file)
        file.visititems(lambda path, item: found.extend(kinds(item)))
    assert {kind.kind for kind in found} <= set("fiuS"), "only plain numbers and fixed-length bytes"


def _scale(dataset, factor):
    dataset[...] = dataset[()] * factor


def _reverse(dataset, axis=0):
    dataset[...] = np.flip(dataset[()], axis)


def _swap_frequencies(file):
    file["modes/frequency"][:2] = file["modes/frequency"][:2][::-1]


def _move_root(file):
    file["modes/displacement/0000"][int(file["interfaces/root/nodes"][0])] = [1e-9, 0, 0]


DAMAGES = {
    "modes orthonormal": lambda file: _scale(file["inertia/second_moment"], 1.001),
    "lumped orthonormality": lambda file: _scale(file["modes/displacement/0001"], 1.01),
    "root nodes do not move": _move_root,
    "node masses sum to the mass": lambda file: _scale(file["mesh/node_mass"], 1.001),
    "node masses balance about the centre of mass": lambda file: _reverse(file["mesh/node_mass"]),
    "frequencies positive and ascending": _swap_frequencies,
    "central inertia positive definite": lambda file: _scale(file["body/inertia"], -1),
    "centre of mass inside the bounding box": lambda file: file["body/center_of_mass"].write_direct(np.array([99.0, 0, 0])),
    "lumped momentum": lambda file: _scale(file["inertia/momentum"], -1),
    "effective masses within the mass": lambda file: _scale(file["inertia/momentum"], 1.5),
    "cells: type and node numbers": lambda file: file["mesh/cells"].__setitem__((0, 0), 10 ** 6),
    "all numbers finite": lambda file: file["modes/displacement/0003"].__setitem__((0, 0), np.nan),
    "interface tip: translation is the weighted mean of its nodes": lambda file: _scale(file["interfaces/tip/displacement"], 1.01),
    "interface tip: weights sum to one": lambda file: _scale(file["interfaces/tip/weights"], 1 + 1e-9),
    "geometric stiffness symmetric": lambda file: file["geometric/stiffness"].__setitem__((8, 0, 1), 1e6),
    "lumped inertia": lambda file: _scale(file["mesh/points"], 1000),
    "surface triangles face outward": lambda file: _reverse(file["mesh/surface_triangles"], axis=1),
}


@pytest.mark.parametrize("rule", DAMAGES)
def test_a_generators_fault_breaks_the_rule_made_for_it(rule, modes_folder, tmp_path):
    path = tmp_path / "damaged.h5"
    shutil.copy(modes_folder / "boom_cantilever.h5", path)
    with h5py.File(path, "a") as file:
        DAMAGES[rule](file)
        file.attrs["content_sha256"] = np.bytes_(modal_file.digest(file))
    assert rule in [broken.name for broken in validate.validate(path) if not broken.holds]


@pytest.mark.parametrize("dataset", ["mesh/points", "modes/displacement/0001", "inertia/second_moment", "interfaces/root/weights"])
def test_a_number_changed_by_one_part_in_1e15_breaks_the_digest(dataset, modes_folder, tmp_path):
    path = tmp_path / "changed.h5"
    shutil.copy(modes_folder / "boom_cantilever.h5", path)
    with h5py.File(path, "a") as file:
        values = file[dataset][()]
        file[dataset][...] = np.nextafter(values, np.inf, dtype=values.dtype)
    assert "content_sha256" in [rule.name for rule in validate.validate(path) if not rule.holds]


def test_a_bit_flipped_on_disk_is_seen_by_the_checksum(modes_folder, tmp_path):
    path = tmp_path / "flipped.h5"
    content = bytearray((modes_folder / "boom_cantilever.h5").read_bytes())
    with h5py.File(modes_folder / "boom_cantilever.h5") as file:
        chunk = file["modes/displacement/0002"].id.get_chunk_info(0)
    content[chunk.byte_offset + chunk.size // 2] ^= 1
    path.write_bytes(content)
    assert any(not rule.holds and "can be read" in rule.name for rule in validate.validate(path))
