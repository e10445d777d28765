import dataclasses

import pytest

from rosbot_patrol.alerts.records import chain


def links(*bodies):
    made, before = [], (0, chain.START)
    for i, body in enumerate(bodies):
        made.append(chain.make_link(before, chain.RECORD, f"id{i}", 100.0 + i, chain.canonical(body)))
        before = (made[-1].n, made[-1].hash)
    return made


def first_problem(made):
    before = (0, chain.START)
    for link in made:
        problem = chain.link_problem(link, before)
        if problem:
            return link.n, problem
        before = (link.n, link.hash)
    return None


def test_a_chain_fits():
    assert first_problem(links({"a": 1}, {"b": 2}, {"c": 3})) is None


@pytest.mark.parametrize(
    "change", [{"body": '{"b":3}'}, {"digest": "0" * 64}, {"wall": 7.0}, {"incident": "x"}, {"kind": chain.REMOVAL}]
)
def test_each_change_of_a_link_is_found_at_it(change):
    made = links({"a": 1}, {"b": 2}, {"c": 3})
    made[1] = dataclasses.replace(made[1], **change)
    number, problem = first_problem(made)
    assert number == 2
    assert "was changed" in problem


def test_a_link_made_anew_is_found_at_the_next():
    made = links({"a": 1}, {"b": 2}, {"c": 3})
    made[1] = chain.make_link((1, made[0].hash), chain.RECORD, "id1", 101.0, chain.canonical({"b": 3}))
    assert first_problem(made) == (
        3,
        "it does not follow the link before it: one of the two was changed, removed or moved",
    )


def test_removed_and_moved_links_are_found():
    made = links({"a": 1}, {"b": 2}, {"c": 3})
    assert first_problem([made[0], made[2]]) == (3, "1 link is missing before it")
    swapped = [dataclasses.replace(made[1], n=1), dataclasses.replace(made[0], n=2), made[2]]
    assert first_problem(swapped)[0] == 1


def test_a_body_that_was_removed_leaves_the_chain_whole():
    made = links({"a": 1}, {"b": 2}, {"c": 3})
    made[1] = dataclasses.replace(made[1], body=None)
    assert first_problem(made) is None


def test_the_same_tree_is_the_same_text():
    tree = {"b": (1, 2.5), "a": {"z": None, "y": "Küche 台所"}, "nan": float("nan"), "lone": "\ud800"}
    assert chain.canonical(tree) == '{"a":{"y":"Küche 台所","z":null},"b":[1,2.5],"lone":"?","nan":null}'
