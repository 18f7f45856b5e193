"""Settings of scanners that change while a robot drives."""

from web_pages import Frame, Page


async def spawn(page: Page) -> str:
    name = await page.spawn(pose=[-8.0, 0.0, 0.0])
    await page.send("select", robot=name)  # only its settings are sent

    def has_settings(frame: Frame) -> bool:
        return any(scan["settings"] for scan in frame.robot(name).get("scans", ()))

    await page.see(has_settings)
    return name


async def test_range_changes_with_the_next_scan(page: Page) -> None:
    name = await spawn(page)
    change = {"robot": name, "scanner": "lms200", "key": "max_range"}
    await page.send("setting", **change, value=3.0)

    def is_short(frame: Frame) -> bool:
        ranges = frame.scan(name, "lms200")
        return bool(((ranges < 300) | (ranges == 65535)).all())

    frame = await page.see(is_short)
    (scan,) = frame.robot(name)["scans"]
    assert scan["max"] == 3.0
    assert scan["settings"]["max_range"] == 3.0


async def test_what_the_server_refuses_is_reported_and_undone(page: Page) -> None:
    name = await spawn(page)
    change = {"robot": name, "scanner": "lms200", "key": "resolution_deg"}
    await page.send("setting", **change, value=0.01)  # more rays than it allows
    assert "rays" in (await page.hear("error"))["text"]

    def is_back(frame: Frame) -> bool:
        settings = frame.robot(name)["scans"][0]["settings"]
        return bool(settings["resolution_deg"] == 1)

    await page.see(is_back)


async def test_power_can_be_unlimited_and_choices_left_to_the_sensor(
    page: Page,
) -> None:
    name = await spawn(page)
    change = {"robot": name, "scanner": "lms200"}
    values = {"penetration_power": None, "ray_choice": None, "max_bounces": 1}
    values |= {"incidence_weights": True}
    for key, value in values.items():
        await page.send("setting", **change, key=key, value=value)
    await page.send("setting", **change, key="return_mode", value="first")

    def is_set(frame: Frame) -> bool:
        settings = frame.robot(name)["scans"][0]["settings"]
        return bool(settings["return_mode"] == "first")

    settings = (await page.see(is_set)).robot(name)["scans"][0]["settings"]
    assert settings.items() >= values.items()
    later = page.frames + 5
    await page.see(lambda _: page.frames > later)
    assert page.texts == [] or "error" not in {text["op"] for text in page.texts}


async def test_wrong_values_change_nothing_that_is_shown(page: Page) -> None:
    wrong: list[tuple[str, object]] = [
        ("max_range", "20"),  # a text
        ("max_range", True),
        ("medium", "laser"),
        ("side_offset_uu", "5 #"),
        ("penetration_power", 10**1000),
        ("return_mode", "last} {Opcode RESET"),
    ]
    name = await spawn(page)
    assert page.frame is not None
    before = page.frame.robot(name)["scans"][0]["settings"]
    for key, value in wrong:
        change = {"robot": name, "scanner": "lms200", "key": key}
        await page.send("setting", **change, value=value)
        assert (await page.hear("error"))["text"]
        page.frame = None
        frame = await page.see(lambda frame: frame.robot(name))
        assert frame.robot(name)["scans"][0]["settings"] == before
    await page.send("setting", robot=name, scanner="x", key="max_range", value=1)
    assert "no scanner 'x'" in (await page.hear("error"))["text"]


async def test_each_setting_takes_the_value_that_it_has(page: Page) -> None:
    name = await spawn(page)
    assert page.frame is not None
    settings = page.frame.robot(name)["scans"][0]["settings"]
    change = {"robot": name, "scanner": "lms200"}
    for offer in page.hello["settings"]:
        if (value := settings[offer["key"]]) is not None:
            await page.send("setting", **change, key=offer["key"], value=value)
    await page.send("stop", robot="nothing")
    assert "'nothing'" in (await page.hear("error"))["text"]
