"""What masks the address of a webhook, and that no mistake in the file of the channels shows it."""

from urllib.parse import unquote

import pytest

from rosbot_patrol.alerts.channels.config import Surroundings, make_channels
from rosbot_patrol.alerts.channels.masking import Mask, masked_url, url_secrets
from rosbot_patrol.alerts.channels.params import MailParams
from rosbot_patrol.alerts.channels.transports.webhook import check_url
from rosbot_patrol.errors import ParamError

SECRET, KEY = "Xk29-topSecret_hook", "q7%2BKEYvalue"


TOKEN = "tok-3n0fMine"


def leaks(text):
    return [part for part in (SECRET, SECRET.lower(), KEY, unquote(KEY), "KEYvalue", TOKEN) if part in text]


@pytest.mark.parametrize(
    "text",
    [
        "channels: {phone: https://x.org/Xk29-topSecret_hook}",
        "channels: {phone: [https://x.org/Xk29-topSecret_hook]}",
        "channels: {phone: {type: webhook, url: [https://x.org/Xk29-topSecret_hook]}}",
        "channels: {phone: {type: webhook, url: {a: https://x.org/Xk29-topSecret_hook}}}",
        "channels: {phone: {type: https://x.org/Xk29-topSecret_hook}}",
        "channels: {phone: {type: webhook, url: 'https://x.org:Xk29-topSecret_hook'}}",
        "channels: {phone: {type: webhook, url: 'https://me:Xk29-topSecret_hook@x.org/'}}",
        "channels: {phone: {type: webhook, url: 'https://x.org/Xk29-topSecret_hook b'}}",
        "channels: {phone: {type: webhook, url: 'ftp://x.org/Xk29-topSecret_hook'}}",
        "channels: {phone: {type: webhook, url: https://x.org/Xk29-topSecret_hook, kinds: [all]}}",
        "channels: {phone: {type: webhook, url: 'https://x.org/Xk29-topSecret_hook}}",
        "https://x.org/Xk29-topSecret_hook",
        "channels: https://x.org/Xk29-topSecret_hook",
    ],
)
def test_no_mistake_in_the_file_shows_it(tmp_path, text):
    path = tmp_path / "channels.yaml"
    path.write_text(text)
    with pytest.raises(ParamError, match=r"channels\.yaml") as caught:
        make_channels(MailParams(channels=str(path)), Surroundings(home=tmp_path, environ={}))
    assert leaks(str(caught.value)) == []


def test_a_port_that_is_none_is_not_repeated():
    assert check_url("https://x.org:geheim/") == "is no web address: its host or port cannot be read"


@pytest.mark.parametrize(
    ("url", "shown"),
    [
        ("https://x.org/hook", "https://x.org:443/..."),
        ("http://x.org", "http://x.org:80/..."),
        ("https://[2001:db8::1]:8123/api?x=1", "https://[2001:db8::1]:8123/..."),
    ],
)
def test_host_and_port_are_shown(url, shown):
    assert masked_url(url) == shown


def test_a_mask_of_nothing_changes_nothing():
    assert Mask([])("as it is") == "as it is"
    assert Mask(["", "/"])("/") == Mask(["/"])("/")
    assert url_secrets("https://x.org/") == []
