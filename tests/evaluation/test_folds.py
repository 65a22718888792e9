"""`p3i eval --fold`: the halves of a set share no photo, are all of it together, and hold all kinds alike."""

import json
from collections import Counter
from pathlib import Path

import pytest

import p3i
from p3i.cli.main import run
from p3i.errors import UsageError
from p3i.evaluation.folds import Fold
from p3i.evaluation.truth import Truth, read_truth, truth_of


def photo(name: str, structure: str, *, reliable: bool = True) -> Truth:
    return truth_of(
        {
            "file": name,
            "width": 64,
            "height": 48,
            "structure": structure,
            "pose": {"rx": 0, "ry": 0},
            "pose_reliable": reliable,
            "centers": [[1, 2], [3, 4]],
        }
    )


TRUTHS = [
    photo(f"{letter}.jpg", structure, reliable=letter < "k")
    for structure, letters in (("lattice", "zbdfhjlnp"), ("circular", "acegik"), ("hybrid", "qs"))
    for letter in letters
]


def test_two_halves_are_the_whole_set_without_a_photo_twice() -> None:
    first, second = (Fold.parse(text).of(TRUTHS) for text in ("1/2", "2/2"))
    assert {one.file for one in first} | {one.file for one in second} == {one.file for one in TRUTHS}
    assert len(first) + len(second) == len(TRUTHS)


def test_each_half_has_as_many_of_each_kind_give_or_take_one() -> None:
    first, second = (
        Counter((one.structure, one.pose_reliable) for one in Fold(k, 2).of(TRUTHS)) for k in (1, 2)
    )
    assert first.keys() | second.keys() == {(one.structure, one.pose_reliable) for one in TRUTHS}
    assert all(abs(first[kind] - second[kind]) <= 1 for kind in first | second)


def test_a_half_follows_from_names_not_from_the_order_of_the_annotations() -> None:
    again = Fold(1, 2).of(TRUTHS[::-1])
    assert {one.file for one in again} == {one.file for one in Fold(1, 2).of(TRUTHS)}


@pytest.mark.parametrize("text", ["0/2", "3/2", "1", "1/0", "a/b", "", "-1/2", "1/2/3"])
def test_what_is_no_part_is_refused_by_name(text: str) -> None:
    with pytest.raises(UsageError, match="fold"):
        Fold.parse(text)


def test_eval_scores_the_half_it_is_asked_for_and_says_which(tmp_path: Path, capsys) -> None:
    folder = tmp_path / "set"
    p3i.examples(folder, lattices=3, rings=0, hybrids=0)
    nothing = tmp_path / "none.jsonl"
    nothing.write_text(json.dumps({"image": "lattice_000.png", "program": None}) + "\n")
    told = {}
    for fold in ("1/2", "2/2"):
        out = tmp_path / f"{fold[0]}.json"
        words = ["--results", str(nothing), "--out", str(out), "--fold", fold]
        assert run(["eval", str(folder), *words]) == 0
        assert f"fold {fold}" in capsys.readouterr().out
        told[fold] = json.loads(out.read_text())
    assert [told[fold]["fold"] for fold in told] == ["1/2", "2/2"]
    for fold, said in told.items():
        assert [row["file"] for row in said["rows"]] == [
            one.file for one in Fold.parse(fold).of(read_truth(folder))
        ]
    assert all(said["rows"] for said in told.values())
