"""A new experiment by the page alone: from an empty data folder to a solved room, and its room changed later."""

import re

from playwright.sync_api import Locator, Page, expect

from tests.browser.conftest import Opens, Station, snapshot
from tests.browser.test_story import PAINTED


class Hand:
    """Counts what an operator does."""

    def __init__(self, page: Page) -> None:
        self.page = page
        self.done = 0

    def click(self, place: Locator) -> None:
        place.click()
        self.done += 1

    def fill(self, label: str, text: str) -> Locator:
        """Choosing the field and typing are two."""
        field = self.page.get_by_label(label, exact=True).first
        field.fill(text)
        field.blur()
        self.done += 2
        return field

    def next_step(self, label: str) -> None:
        button = self.page.locator("button.next")
        expect(button).to_have_text(label)
        self.click(button)


def chosen(station: Station, opens: Opens) -> Hand:
    """The simulated camera is chosen from the list of those found."""
    hand = Hand(opens(station.address).page)
    hand.click(hand.page.get_by_role("button", name="New experiment"))
    hand.click(hand.page.get_by_role("radio", name=re.compile("Simulated camera")))
    return hand


def test_from_an_empty_folder_to_a_solved_room(station: Station, opens: Opens):
    hand = chosen(station, opens)
    page = hand.page
    hand.fill("Name", "Nine in the evening")
    expect(page.locator("main")).to_contain_text("The picture covers 5.41 × 4.06 m")
    hand.next_step("Create the experiment")
    hand.next_step("Calibrate")
    hand.next_step("Take the reference")
    hand.next_step("Take the flow")
    hand.click(page.get_by_role("button", name="Reconstruct", exact=True).first)
    hand.click(page.get_by_role("radio", name=re.compile("^draft")))
    hand.next_step("Reconstruct")
    hand.next_step("Look at the result")
    expect(page.locator(".slice canvas").first).to_have_attribute("data-painted", PAINTED)
    print(f"interactions: {hand.done}")
    assert hand.done <= 60
    # Another room: the result says so, and one click solves again.
    page.get_by_role("button", name="Rig", exact=True).click()
    page.get_by_role("button", name="Edit room").click()
    expect(page.get_by_label("Name", exact=True)).to_have_value("Nine in the evening")
    supply = page.get_by_role("group", name="supply 1").first
    supply.get_by_label("Temperature", exact=True).fill("29 C")
    page.locator("button.next", has_text="Change the room").click()
    expect(page.locator("main")).to_contain_text("made with another room")
    page.get_by_role("button", name="Solve again").click()
    expect(page.locator("footer")).to_contain_text("1 job in progress")


def test_a_mistake_is_told_at_its_field_while_it_is_typed_and_can_be_undone(station: Station, opens: Opens):
    hand = chosen(station, opens)
    page = hand.page
    field = hand.fill("Depth along y", "3000 m")
    expect(field).to_have_attribute("aria-invalid", "true")
    expect(page.locator("[id='told-room[1]']")).to_contain_text("millimetres")
    expect(page.locator("button.next")).to_have_text("1 to correct")
    page.keyboard.press("Control+z")
    expect(field).to_have_value("3 m")
    expect(page.locator("button.next")).to_have_text("Create the experiment")
    page.keyboard.press("Control+y")
    expect(field).to_have_value("3000 m")
    # A bare number gets the usual unit.
    hand.fill("Depth along y", "3")
    expect(field).to_have_value("3 m")


def test_an_opening_is_moved_by_keys_and_by_pointer_and_the_draft_survives_a_reload(
    station: Station, opens: Opens
):
    hand = chosen(station, opens)
    page = hand.page
    supply = page.get_by_role("button", name=re.compile("^supply 1 on"))
    supply.focus()
    page.keyboard.press("ArrowRight")
    page.keyboard.press("ArrowUp")
    page.keyboard.press("Shift+ArrowRight")
    things = page.get_by_role("group", name="supply 1").first
    expect(things.get_by_label("y from")).to_have_value("1.21 m")
    expect(things.get_by_label("z from")).to_have_value("1.61 m")
    expect(things.get_by_label("y to")).to_have_value("1.82 m")
    box = supply.locator("rect").bounding_box()
    page.mouse.move(box["x"] + box["width"] / 3, box["y"] + box["height"] / 2)
    page.mouse.down()
    page.mouse.move(box["x"] + box["width"] / 3, box["y"] + box["height"] / 2 - 40, steps=4)
    page.mouse.up()
    expect(things.get_by_label("z from")).not_to_have_value("1.61 m")
    moved = things.get_by_label("z from").input_value()
    expect(page.locator("button.next")).to_have_text("Create the experiment")
    snapshot(page, "new-room")
    page.reload()
    expect(page).to_have_url(re.compile("#/new$"))
    expect(things.get_by_label("z from")).to_have_value(moved)
