"""Recipients as the parameters and the file name them."""

import pytest

from rosbot_patrol.alerts.channels.channel import Channel
from rosbot_patrol.alerts.channels.config import Surroundings, make_channels
from rosbot_patrol.alerts.channels.mail import make_envelope, parse_addresses
from rosbot_patrol.alerts.channels.params import MailParams
from rosbot_patrol.alerts.channels.transports.smtp import SmtpServer as Server
from rosbot_patrol.alerts.channels.transports.smtp import SmtpTransport
from rosbot_patrol.errors import ParamError

A, B, C = "a@example.org", "b@example.org", "c@example.org"


def test_letters_before_the_at_sign_may_have_a_case():
    assert len(parse_addresses("~x", "Anna@x.org, anna@x.org")) == 2


def test_an_address_beyond_ascii_is_refused_with_what_to_do():
    for given in (f"{A}, küche@x.org", f"{A}, a@küche.org"):
        with pytest.raises(ParamError, match=r"~email_to: expected a mail address, .* only ASCII letters"):
            make_envelope(given, "", names=("~email_to", "~email_from"))


def test_a_transport_for_several_recipients_cannot_be_made():
    with pytest.raises(ValueError, match="expected one recipient, got 2"):
        SmtpTransport(Server(), make_envelope(f"{A}, {B}", ""))


def test_channels_of_a_file_are_split_likewise(tmp_path):
    path = tmp_path / "channels.yaml"
    path.write_text(f"channels: {{office: {{type: smtp, to: '{A}, {B}', kinds: [incident], interval: 3}}}}")
    made = make_channels(MailParams(channels=str(path)), Surroundings(home=tmp_path, environ={}))
    assert [c.name for c in made] == ["mail", f"office:{A}", f"office:{B}"]
    assert {(c.kinds, c.pace.interval) for c in made[1:]} == {(("incident",), 3.0)}
    assert made[1].is_beside(made[2])
    assert not made[0].is_beside(made[1])
    assert isinstance(made[1], Channel)
