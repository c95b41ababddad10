# SPDX-License-Identifier: GPL-3.0-or-later
"""The troubleshooting page explains what the code says: all of it, and nothing that it does not say any more."""

from spoken import Message, entries, explains, messages


def test_each_message_of_the_code_is_explained():
    quoted = entries()
    missing = [f"{each.where}: {each.text}" for each in messages() if not any(explains(one, each) for one in quoted)]
    assert not missing, "docs/troubleshooting.md says nothing about\n" + "\n".join(missing)


def test_each_entry_is_still_said():
    said = messages()
    stale = [one for one in entries() if not any(explains(one, each) for each in said)]
    assert not stale, "nothing in the code says any more what docs/troubleshooting.md quotes:\n" + "\n".join(stale)


def test_messages_are_found_in_the_source():
    """The search itself: sentences of each kind, each from another place."""
    texts = [each.text for each in messages()]
    for expected in (
        'Camera "…" is orthographic: a black hole needs a place to be seen from; make the camera perspective.',  # raise
        "Baking was stopped; the maps that are finished stay.",  # report
        "This scene has no black hole.",  # the panel
        "note: … pixels could not be resolved and will show magenta",  # standard error
        "Frame … was rendered without its warp map or lens.",  # handed on to be said
        "Warp maps are being baked already",  # why a button is gray
    ):
        assert expected in texts
    assert len(texts) > 120


def test_an_entry_explains_what_it_quotes_alone():
    assert explains("Cannot write …: …; free some", Message("Cannot write …: …; free some space.", ""))
    assert not explains("Cannot write …: …; free some", Message("Cannot write …: …; choose another folder.", ""))
    assert explains("The … is …", Message("The … is …", ""))
    assert not explains("The … is …", Message("The picture is unknown.", ""))
