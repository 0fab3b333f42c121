"""Files of banks: one for each affordance and gripper, written whole or not at all."""

import hashlib
import json
import re
from pathlib import Path

from anysim.errors import AssetError
from anysim.skills.bank import Bank, read_bank
from anysim_banks.making import Order
from anysim_banks.method import Method


def bank_path(folder: Path, name: str, method: Method, robot: str = "") -> Path:
    """Where the bank of an affordance is, `name` being what its asset is called; what differs has a name of its own."""
    subject, tool = method.subject, method.tool
    digest = hashlib.sha256(f"{subject.hash} {subject.place} {tool.hash}".encode()).hexdigest()[:8]
    parts = (name, subject.affordance.name, tool.name, *filter(None, [robot]), digest)
    return folder / (".".join(re.sub(r"[^\w.=-]+", "_", part).strip("_") for part in parts) + ".json")


def stored(path: Path, method: Method, order: Order) -> Bank | None:
    """The bank that is there already, if it is of this very subject, tool and order; else None."""
    try:
        bank = read_bank(path)
    except AssetError:
        return None
    same = (bank.asset_hash, bank.gripper_hash) == (method.subject.hash, method.tool.hash)
    about = {"place": method.subject.place, "asked": order.asked, "seed": order.seed}
    return bank if same and all(bank.provenance.get(key) == value for key, value in about.items()) else None


def write(path: Path, bank: Bank) -> None:
    """Write a bank over whatever is there."""
    path.parent.mkdir(parents=True, exist_ok=True)
    aside = path.with_suffix(".part")
    aside.write_text(json.dumps(bank.document(), indent=1) + "\n")
    aside.replace(path)
