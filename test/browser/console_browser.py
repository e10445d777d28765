"""A real browser (Debian's chromium, by Selenium) before the console, which runs before a real patrol."""

import contextlib
import os
import signal
import subprocess
import time
from pathlib import Path

import pytest

pytest.importorskip("selenium", reason="needs python3-selenium and chromium-driver")

from selenium import webdriver
from selenium.common.exceptions import StaleElementReferenceException, WebDriverException
from selenium.webdriver.chrome.options import Options
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys

PHONE, DESK = (390, 844), (1440, 900)
PATIENCE = 20.0
_FLAGS = (
    "--headless=new",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-dev-shm-usage",
    "--disable-background-networking",
)


class Browser:
    """One browser window of its own, with no cookies of others."""

    def __init__(self, url, size=PHONE, language="en", dark=False):
        options = Options()
        for flag in (*_FLAGS, f"--window-size={size[0]},{size[1]}", f"--lang={language}"):
            options.add_argument(flag)
        options.add_experimental_option("prefs", {"intl.accept_languages": language})
        options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
        self.driver = webdriver.Chrome(service=Service("/usr/bin/chromedriver"), options=options)
        self.driver.set_page_load_timeout(30)
        self.url = url
        screen = {"width": size[0], "height": size[1], "deviceScaleFactor": 1, "mobile": size[0] < 600}
        self.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", screen)
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [scheme]})

    def open(self, path="/"):
        self.driver.get(self.url + path)

    @property
    def path(self):
        return self.driver.current_url.removeprefix(self.url)

    @property
    def text(self):
        return self.driver.find_element(By.TAG_NAME, "body").text

    def wait(self, condition, what, seconds=PATIENCE):
        deadline = time.monotonic() + seconds
        while time.monotonic() < deadline:
            with contextlib.suppress(StaleElementReferenceException, WebDriverException):
                if found := condition():
                    return found
            time.sleep(0.05)
        self.save("failed")
        raise AssertionError(
            f"{what} did not come within {seconds} s; the page at {self.path} says: {self.text[:2000]}"
        )

    def see(self, text, seconds=PATIENCE):
        self.wait(lambda: text in self.text, f"'{text}'", seconds)

    def miss(self, text, seconds=PATIENCE):
        self.wait(lambda: text not in self.text, f"the end of '{text}'", seconds)

    def find(self, xpath, seconds=PATIENCE):
        def shown():
            return next((e for e in self.driver.find_elements(By.XPATH, xpath) if e.is_displayed()), None)

        return self.wait(shown, xpath, seconds)

    def button(self, name):
        quoted = f'"{name}"'
        return self.find(f"//button[.//*[normalize-space(text())={quoted}] or @aria-label={quoted}]")

    def press(self, name):
        self._click(lambda: self.button(name), f"the button '{name}'")

    def press_for(self, name, text):
        """Press a button of a list until what it opens is there: the list may be drawn anew under the press."""
        for _ in range(5):
            self.press(name)
            with contextlib.suppress(AssertionError):
                return self.see(text, 4.0)
        return self.see(text)

    def click(self, xpath):
        self._click(lambda: self.find(xpath), xpath)

    def _click(self, find, what):
        """Click on an element; on the one in its place where the page is drawn anew between finding and clicking."""

        def clicked():
            element = find()
            self.driver.execute_script("arguments[0].scrollIntoView({block: 'center'})", element)
            element.click()
            return True

        self.wait(clicked, what)

    def field(self, label):
        return self.find(f'//input[@aria-label="{label}"]')

    def type(self, label, text):
        field = self.field(label)
        field.send_keys(Keys.CONTROL, "a")
        field.send_keys(text)

    def choose(self, label, text):
        """Choose from a list."""
        self.click(f'//label[contains(@class, "q-select")][.//*[normalize-space(text())="{label}"]]')
        self.click(f'//*[contains(@class, "q-menu")]//*[normalize-space(text())="{text}"]')

    def sign_in(self, name, password):
        for key, value in (("name", name), ("password", password)):
            field = self.find(f'//input[@id="{key}"]')
            field.clear()
            field.send_keys(value)
        button = self.find('//button[@type="submit"]')
        button.click()

        def is_answered():
            try:
                return not button.is_enabled()
            except StaleElementReferenceException:
                return True

        deadline = time.monotonic() + PATIENCE  # what is opened before the answer would be overtaken by it
        while not is_answered():
            assert time.monotonic() < deadline, "no answer to the sign-in"
            time.sleep(0.05)

    def save(self, name):
        if folder := os.environ.get("ROSBOT_TEST_PICTURES"):
            Path(folder).mkdir(parents=True, exist_ok=True)
            self.driver.save_screenshot(f"{folder}/{name}.png")

    def inaccessible(self):
        """What axe finds on the page that shuts people out: (rule, what it is about)."""
        import axe_core_python

        script = Path(axe_core_python.__file__).with_name("axe.min.js").read_text(encoding="utf-8")
        self.driver.execute_script(script)
        run = "axe.run().then(found => arguments[0](found.violations), err => arguments[0](String(err)))"
        found = self.driver.execute_async_script(run)
        assert isinstance(found, list), found
        grave = [each for each in found if each["impact"] in ("serious", "critical")]
        return [(each["id"], [node["html"][:200] for node in each["nodes"]]) for each in grave]

    def problems(self):
        """What the browser's own log complains of, besides a refused sign-in."""
        severe = [entry["message"] for entry in self.driver.get_log("browser") if entry["level"] == "SEVERE"]
        return [message for message in severe if "/sign-in" not in message]

    def die(self):
        """End the browser as a phone without power does."""
        driver = str(self.driver.service.process.pid)
        parents = {path: path.read_text().rpartition(")")[2].split()[1] for path in Path("/proc").glob("[0-9]*/stat")}
        children = [int(path.parent.name) for path, parent in parents.items() if parent == driver]
        assert children
        for pid in children:
            os.kill(pid, signal.SIGKILL)

    def close(self):
        self.driver.quit()


class Console:
    """The console as a process, and browsers before it."""

    def __init__(self, house):
        self.house, self.browsers = house, []
        self.state = house.folder / "state"
        self.url = ""

    def start(self, **params):
        values = {"port": 18420, "path_to_params": self.house_file(), "state_dir": str(self.state), **params}
        self.process = self.house._start(["rosrun", "rosbot_patrol", "console"], values)
        deadline = time.monotonic() + 40
        while "the console is at" not in (said := self.house.log(self.process)):
            assert time.monotonic() < deadline, said
            assert self.process.poll() is None, said
            time.sleep(0.05)
        self.url = said.partition("the console is at ")[2].split()[0]

    def start_camera(self):
        topics = ["in:=/camera/rgb/image_raw", "out:=rgb_republish"]
        command = ["rosrun", "rosbot_patrol", "republish", "raw", topics[0], "compressed", topics[1]]
        self.house._start(command, {})

    def start_map(self):
        root = Path(__file__).resolve().parents[2]
        self.house._start(["rosrun", "rosbot_patrol", "map_server", str(root / "maps" / "rosbot_map.yaml")], {})

    def house_file(self):
        return str(Path(__file__).resolve().parents[2] / "params" / "room_points.yaml")

    def add(self, name, password, role="owner"):
        command = ["rosrun", "rosbot_patrol", "console", "--add", name, "--role", role, "--state-dir", str(self.state)]
        done = subprocess.run(command, input=password + "\n", text=True, capture_output=True, timeout=60, check=False)
        assert done.returncode == 0, done.stderr

    def browser(self, path="/", **given):
        browser = Browser(self.url, **given)
        self.browsers.append(browser)
        browser.open(path)
        return browser

    def close(self):
        for browser in self.browsers:
            browser.close()
