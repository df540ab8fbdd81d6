"""The page in a browser: a real mission behind it, a recording, and what hostile robots say."""

import re
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from playwright.sync_api import Browser, BrowserContext, Page, expect, sync_playwright
from support.processes import Processes, read_until
from support.telling import TOKEN, Noting, Telling, page_of

from lalliance_agents.wire.keys import Kind

CHROMIUM = Path("/usr/bin/chromium")
FLAGS = [
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync",
]  # fmt: skip

#: Long enough for everything that is done to it, and short where something is waited for.
MISSION = """\
name: excavation
tasks: {dig: {}, haul: {}}
robots:
  mole: {tasks: {dig: 60}}
  ox: {tasks: {haul: 60}}
  ant: {tasks: {dig: 90}}
knowledge: given
parameters: {min_delay: 0.1, max_delay: 0.5, silence_timeout: 1.0, broadcast_rate: 5}
deadline: 300
seed: 3
"""

pytestmark = pytest.mark.skipif(
    not CHROMIUM.exists(), reason="there is no /usr/bin/chromium; Debian's package chromium brings it"
)


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with sync_playwright() as play:
        chromium = play.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield chromium
        chromium.close()


class Tab:
    """A page in a browser of its own, with all that it asked for and complained of."""

    def __init__(self, context: BrowserContext) -> None:
        self.page: Page = context.new_page()
        self.complaints: list[str] = []
        self.asked: list[str] = []
        self.page.on("console", lambda told: self.complaints.append(told.text) if told.type != "log" else None)
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("request", lambda request: self.asked.append(request.url))
        self.page.on("websocket", lambda socket: self.asked.append(socket.url))

    def hosts(self) -> set[str | None]:
        return {urlsplit(url).hostname for url in self.asked}


@pytest.fixture
def tab(browser: Browser) -> Iterator[Tab]:
    context = browser.new_context(viewport={"width": 1440, "height": 1000})
    context.set_default_timeout(20_000)
    yield Tab(context)
    context.close()


@pytest.fixture
def processes(tmp_path: Path) -> Iterator[Processes]:
    (tmp_path / "excavation.yaml").write_text(MISSION)
    with Processes(tmp_path) as tree:
        yield tree


def timeline_tells(page: Page, wanted: str, steps: int = 40) -> str:
    """Go through the timeline by keyboard until it tells of `wanted`; what it tells."""
    page.locator("#timeline-plot").focus()
    page.keyboard.press("Escape")
    for _ in range(steps):
        page.keyboard.press("ArrowRight")
        if re.search(wanted, told := page.locator("#tip").inner_text()):
            return told
    raise AssertionError(f"the timeline does not tell of {wanted!r}")


@pytest.mark.alone
def test_a_crash_injected_by_clicking_and_the_takeover_after_it(processes: Processes, tab: Tab, tmp_path: Path) -> None:
    """One real mission: injecting, the takeover on the timeline, scrubbing back, and the recording of all that."""
    recorded = tmp_path / "excavation.mcap"
    running = processes.start("run", "excavation.yaml", "--dashboard", "--port", "0", "--record", recorded, "--plain")
    told = read_until(running, "the page of mission excavation: ")[-1]
    page = tab.page
    page.goto(told.rpartition(" ")[2].strip())
    assert "token" not in page.url
    dig = page.locator(".task", has_text="dig")
    expect(dig).to_contain_text("mole", timeout=20_000)
    # A while, so that there is something to go back to.
    expect(dig).to_contain_text(re.compile("[3-9] %"), timeout=20_000)

    page.get_by_role("radio", name="crash").check(force=True)
    page.locator("#inject select[name=robot]").select_option("mole")
    page.get_by_role("button", name="Inject").click()
    expect(page.locator("#answer")).to_contain_text("crash of mole")
    expect(page.locator("#decisions")).to_contain_text("takes dig from mole (silence)", timeout=20_000)
    expect(dig).not_to_contain_text("mole")
    assert "(silence)" in timeline_tells(page, "takes dig from mole")
    assert "fault 1-crash" in timeline_tells(page, "crash of mole")
    assert "process is gone" in timeline_tells(page, "mole on dig")
    expect(page.locator("#faults-rows")).to_contain_text("crash of mole")

    page.locator("#matrix").press("ArrowDown")
    expect(page.locator("#tip")).to_have_text("mole hears nobody: it is not there.")
    page.locator("#decisions-rows").press("ArrowDown")
    page.keyboard.press("ArrowDown")
    expect(page.locator("#decisions-rows li:nth-child(2) button")).to_be_focused()
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.closest('#faults') !== null")

    page.locator("#slider").focus()
    page.keyboard.press("Home")
    for _ in range(20):
        page.keyboard.press("ArrowRight")
    expect(page.locator("#live")).to_have_attribute("aria-pressed", "false")
    expect(page.locator("#instant")).to_have_text("2.0 s")
    expect(dig).to_contain_text("mole")
    expect(page.locator("#faults-rows")).to_contain_text("No fault so far")
    expect(page.locator("#decisions")).not_to_contain_text("takes dig")
    page.locator("#timeline-plot").focus()
    page.keyboard.press("l")
    expect(page.locator("#live")).to_have_attribute("aria-pressed", "true")
    expect(page.locator("#faults-rows")).to_contain_text("crash of mole")
    assert tab.complaints == []
    assert tab.hosts() == {"127.0.0.1"}
    running.kill()

    shown = processes.start("dashboard", "--bag", recorded, "--port", "0")
    page.goto(read_until(shown, "the page of mission excavation: ")[-1].rpartition(" ")[2].strip())
    expect(page.locator("#about")).to_contain_text("recording")
    expect(page.locator("#inject")).to_be_hidden()
    assert "(silence)" in timeline_tells(page, "takes dig from mole")
    page.locator("#timeline-plot").press("Enter")
    page.keyboard.press(",")
    page.keyboard.press(",")
    expect(dig).to_contain_text("mole")
    assert tab.hosts() == {"127.0.0.1"}


HOSTILE = "<img src=x onerror=\"document.title='broken'\"><script>document.title='broken'</script>"


def test_what_hostile_robots_say_is_shown_as_text(tab: Tab) -> None:
    telling = Telling()
    telling.takeover()
    telling.event("warning", HOSTILE, 6.1, details={"from": HOSTILE})
    telling.event("fault", f"fault: {HOSTILE}", 6.2, details={"name": HOSTILE, "begins": True})
    telling.decide("<b>x</b>", "<i>y</i>", 6.3, by="left", task="a")
    words = {"motivation": "<b>1</b>", "pace": HOSTILE, "own_time": HOSTILE}
    telling.say(Kind.MOTIVATION, 6.4, by="left", active=[], sets={"a": words, "__proto__": words, "constructor": words})
    telling.say(Kind.HELLO, 6.4, by="__proto__", tasks=["constructor"])
    telling.say(Kind.ACTIVITY, 6.5, by="constructor", task="__proto__", trial=1, active_for=0.0, expected=5.0)
    telling.status(6.6, a=0.8)
    with page_of(telling.chronicle, Noting()) as (address, _):
        page = tab.page
        page.goto(address)
        expect(page.locator("#decisions")).to_contain_text("<img src=x onerror=")
        expect(page.locator("#faults-rows")).to_contain_text("<script>document.title=")
        expect(page.locator("#factors")).to_contain_text("a")
        timeline_tells(page, "<script>")
        assert page.locator("main img, main script, main b > *, main i > *").count() == 0
        assert page.title() == "m · lalliance"
    assert [one for one in tab.complaints if "closed" not in one and "refused" not in one.lower()] == []
    assert tab.hosts() == {"127.0.0.1"}


def test_whoever_holds_no_token_sees_no_buttons_and_a_phone_shows_everything(browser: Browser, tab: Tab) -> None:
    telling, noting = Telling(), Noting()
    telling.takeover()
    with page_of(telling.chronicle, noting) as (address, _):
        tab.page.goto(address)
        expect(tab.page.locator("#faults-hint")).to_be_visible()
        expect(tab.page.locator("#inject")).to_be_hidden()
        phone = browser.new_context(viewport={"width": 390, "height": 844}, color_scheme="dark")
        page = phone.new_page()
        page.goto(f"{address}#token={TOKEN}")
        expect(page.get_by_role("button", name="Inject")).to_be_visible()
        assert page.evaluate("document.documentElement.scrollWidth") == 390
        assert page.evaluate("document.documentElement.dataset.theme") == "dark"
        page.get_by_role("radio", name="partition").check(force=True)
        page.locator("select[name=group]").select_option(["left"])
        page.get_by_role("button", name="Inject").click()
        expect(page.locator("#answer")).to_have_text("done")
        phone.close()
    assert noting.requests == [("inject", {"fault": {"partition": [["left"], ["right"]]}, "lasts": None})]
