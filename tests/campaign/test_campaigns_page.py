"""What docs/campaigns.md shows is what works."""

import re
from pathlib import Path

from fpid_pin.campaign.uncertain import QUANTITIES
from fpid_pin.cli.campaign import read_campaign
from fpid_pin.cli.commands import app
from fpid_pin.cli.configuration import demo_config, parse

PAGE = (Path(__file__).parents[2] / "docs" / "campaigns.md").read_text(encoding="utf-8")


def test_its_configuration_is_one(tmp_path):
    (table,) = re.findall(r"^```toml\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)
    study, runs = read_campaign(parse(demo_config().text + table, "page.toml", tmp_path))
    assert runs == 10_000
    assert study.experiment.dynamics == "compiled"
    assert "viscous_friction.1" in study.parameters


def test_its_table_has_every_quantity():
    rows = PAGE[PAGE.index("| key |") :].split("\n\n")[0]
    named = set()
    for cell in re.findall(r"^\| (`.*?) \|", rows, re.MULTILINE):
        first, *others = re.findall(r"`(\w+)`", cell)
        named.add(first)
        prefix = first.partition("_")[0]
        named |= {f"{prefix}{name}" if name.startswith("_") else name for name in others}
    assert named == set(QUANTITIES)


def test_its_commands_are_there():
    import typer.main

    group = typer.main.get_command(app).commands["campaign"]
    told = set(re.findall(r"fpid-pin campaign (\w+)", PAGE))
    assert told == set(group.commands)
    for line in re.findall(r"^    fpid-pin campaign .*$", PAGE, re.MULTILINE):
        options = {o for p in group.commands[line.split()[2]].params for o in p.opts}
        assert set(re.findall(r"(?<=\s)--[a-z-]+", line.partition("#")[0])) <= options, line
