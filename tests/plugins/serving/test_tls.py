"""Services over TLS: the client asks for the certificate, and what cannot be used is told in a sentence."""

import ipaddress
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

import anysim
from anysim.errors import AnysimError, TaskError
from anysim_client.errors import ConnectionLost
from anysim_serving.catalogue import Catalogue
from anysim_serving.server import Service, fresh_token, serving
from anysim_serving.settings import Settings
from tests.plugins.serving.helpers import BLOCKS, local, same

x509 = pytest.importorskip("cryptography.x509", reason="cryptography, which makes the certificates, is not installed")


def certificate(folder: Path, host: str) -> tuple[Path, Path]:
    """PEM files of a certificate of its own making for an address, and of its key."""
    from cryptography.hazmat.primitives import hashes, serialization
    from cryptography.hazmat.primitives.asymmetric import ec

    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, "anysim test")])
    now = datetime.now(UTC)
    made = (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - timedelta(minutes=5))
        .not_valid_after(now + timedelta(hours=1))
        .add_extension(x509.SubjectAlternativeName([x509.IPAddress(ipaddress.ip_address(host))]), critical=False)
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .sign(key, hashes.SHA256())
    )
    public, private = folder / f"{host}.pem", folder / f"{host}.key"
    public.write_bytes(made.public_bytes(serialization.Encoding.PEM))
    plain = serialization.NoEncryption()
    encoding, form = serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8
    private.write_bytes(key.private_bytes(encoding, form, plain))
    return public, private


def test_a_service_over_tls_gives_the_same_bits_to_who_trusts_it_and_nothing_to_others(tmp_path: Path) -> None:
    public, private = certificate(tmp_path, "127.0.0.1")
    other, _ = certificate(tmp_path, "127.0.0.2")
    token = fresh_token()
    with serving(BLOCKS, settings=Settings(token=token, certificate=public, key=private)) as made, local() as here:
        assert made.address.startswith("https://127.0.0.1:")
        with anysim.connect(made.address, token=token, ca=public) as env:
            assert same(env.reset(seed=4)[0], here.reset(seed=4)[0])
            still = np.zeros((here.num_envs, here.action_dim))
            assert same(env.step(still).obs, here.step(still).obs)
        for ca in (None, other):  # of neither a system nor a file that has signed it
            with pytest.raises(
                ConnectionLost, match=r"certificate of https://\S+ is not trusted \(self-signed.*give `ca`"
            ):
                anysim.connect(made.address, token=token, ca=ca)
        with pytest.raises(AnysimError, match="token"):
            anysim.connect(made.address, token="wrong", ca=public)
        with pytest.raises(ConnectionLost, match="no service answers"):  # without TLS
            anysim.connect(made.address.replace("https", "http"), token=token, timeout=5.0)


def test_files_that_are_no_certificates_are_told_of(tmp_path: Path) -> None:
    public, _ = certificate(tmp_path, "127.0.0.1")
    wrong = tmp_path / "wrong.pem"
    wrong.write_text("no certificate\n")
    for settings in (
        Settings(certificate=tmp_path / "absent.pem"),
        Settings(certificate=wrong),
        Settings(certificate=public, key=wrong),
    ):
        with pytest.raises(TaskError, match="the TLS certificate or key cannot be used"):
            Service(Catalogue.of([BLOCKS]), settings)
    for ca in (tmp_path / "absent.pem", wrong):
        with pytest.raises(TaskError, match=f"{ca.name}.* no PEM file of certificates"):
            anysim.connect("https://127.0.0.1:1", ca=ca)
