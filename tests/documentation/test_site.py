"""The site: it builds without a warning, asks nothing of a network, and can be searched even where its pages are files."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from playwright.sync_api import expect, sync_playwright
from support.documents import ROOT

CHROMIUM = shutil.which("chromium")


@pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium; tests/dashboard/browser.sh installs it")
def test_the_site_needs_no_network_to_be_built_read_and_searched(tmp_path: Path) -> None:
    build = [sys.executable, "-m", "mkdocs", "build", "--quiet", "--site-dir", str(tmp_path)]
    built = subprocess.run(build, cwd=ROOT, capture_output=True, text=True, check=False, timeout=100)
    assert built.returncode == 0, built.stderr
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        page = browser.new_page()
        asked: list[str] = []
        page.on("request", lambda request: asked.append(request.url))
        page.on("pageerror", lambda error: asked.append(str(error)))
        page.goto((tmp_path / "study" / "report.html").as_uri())
        found, asking = page.locator(".md-search-result__meta"), page.get_by_role("textbox", name="Search")
        asking.click()
        expect(found).to_contain_text("Type to start searching", timeout=30_000)  # now keys are listened to
        asking.press_sequentially("silence timeout")
        expect(found).to_contain_text("matching documents", timeout=30_000)
        page.locator(".md-search-result__link").first.click()
        page.wait_for_url("**.html?h=**", timeout=30_000)
        browser.close()
    assert [one for one in asked if not one.startswith((tmp_path.as_uri(), "data:", "blob:"))] == []
