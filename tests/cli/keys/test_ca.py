"""Content of certificates, and keys that do not match."""

from datetime import timedelta
from ipaddress import ip_address

import pytest
from cryptography import x509
from cryptography.hazmat.primitives.asymmetric import ec, ed25519
from cryptography.hazmat.primitives.hashes import SHA256
from cryptography.hazmat.primitives.serialization import (
    Encoding,
    NoEncryption,
    PrivateFormat,
    load_pem_private_key,
)
from cryptography.x509.oid import ExtendedKeyUsageOID

from cli.keys.ca import (
    CertificateAuthority,
    certificate_from,
    certificate_pem,
    key_pem,
)
from cli.keys.member_list import DAY_S, profile
from common.errors import RobotError
from common.members import Profile

SPAN = 1.8e9, 1.8e9 + 10 * DAY_S
ROBOT = profile("robot", "001", (), ("10.7.5.220", "robot.lan"))
DRIVER = profile("driver", "anna", ("001",))


@pytest.fixture(scope="module")
def authority() -> CertificateAuthority:
    return CertificateAuthority.create("berlin", SPAN)


def issued(authority: CertificateAuthority, who: Profile) -> x509.Certificate:
    return certificate_from(authority.issue(who, SPAN).certificate)


def no_passphrase() -> bytes:
    raise AssertionError("no passphrase expected")


def test_the_authority_signs_certificates_and_no_other_authority(
    authority: CertificateAuthority,
) -> None:
    found = authority.certificate
    basic = found.extensions.get_extension_for_class(x509.BasicConstraints)
    assert basic.critical
    assert basic.value == x509.BasicConstraints(ca=True, path_length=0)
    usage = found.extensions.get_extension_for_class(x509.KeyUsage)
    assert usage.critical
    assert usage.value.key_cert_sign
    assert not usage.value.digital_signature
    assert found.subject.rfc4514_string() == "CN=T2 CA of berlin"
    assert isinstance(found.signature_hash_algorithm, SHA256)
    found.verify_directly_issued_by(found)


@pytest.mark.parametrize("who", [ROBOT, DRIVER])
def test_every_certificate(authority: CertificateAuthority, who: Profile) -> None:
    made = authority.issue(who, SPAN)
    found = certificate_from(made.certificate)
    found.verify_directly_issued_by(authority.certificate)
    assert found.not_valid_before_utc.timestamp() == SPAN[0]
    assert found.not_valid_after_utc - found.not_valid_before_utc == timedelta(days=10)
    basic = found.extensions.get_extension_for_class(x509.BasicConstraints)
    assert (basic.critical, basic.value.ca) == (True, False)
    usage = found.extensions.get_extension_for_class(x509.KeyUsage)
    assert usage.critical
    assert usage.value.digital_signature
    assert not usage.value.key_cert_sign
    key = load_pem_private_key(made.private_key, None)
    assert isinstance(key, ec.EllipticCurvePrivateKey)
    assert isinstance(key.curve, ec.SECP256R1)
    assert key.public_key() == found.public_key()
    member = made.member
    assert found.subject.rfc4514_string() == f"CN={member.common_name}"
    assert member.common_name == f"{who.label}.{found.serial_number:040x}"[: len(who.label) + 9]
    assert member.expires == found.not_valid_after_utc
    assert (member.label, member.robots, member.addresses) == (who.label, who.robots, who.addresses)


def test_extended_key_usage(authority: CertificateAuthority) -> None:
    server, client = ExtendedKeyUsageOID.SERVER_AUTH, ExtendedKeyUsageOID.CLIENT_AUTH
    for who, expected in ((ROBOT, [server, client]), (DRIVER, [client])):
        usage = issued(authority, who).extensions.get_extension_for_class(x509.ExtendedKeyUsage)
        assert list(usage.value) == expected


def test_a_routers_addresses_are_in_its_certificate(authority: CertificateAuthority) -> None:
    found = issued(authority, ROBOT)
    names = found.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    assert names.get_values_for_type(x509.IPAddress) == [
        ip_address("10.7.5.220"), ip_address("127.0.0.1"),
    ]  # fmt: skip
    assert names.get_values_for_type(x509.DNSName) == ["robot.lan", "localhost"]
    with pytest.raises(x509.ExtensionNotFound):
        issued(authority, DRIVER).extensions.get_extension_for_class(x509.SubjectAlternativeName)


def test_invalid_keys(authority: CertificateAuthority) -> None:
    certificate = certificate_pem(authority.certificate)
    stranger = CertificateAuthority.create("berlin", SPAN)
    with pytest.raises(RobotError, match="does not match the certificate"):
        CertificateAuthority.load(certificate, key_pem(stranger.key), no_passphrase)
    with pytest.raises(RobotError, match="cannot read"):
        CertificateAuthority.load(certificate, b"no key", no_passphrase)
    with pytest.raises(RobotError, match="invalid certificate"):
        CertificateAuthority.load(b"-----BEGIN", key_pem(stranger.key), no_passphrase)
    other_kind = ed25519.Ed25519PrivateKey.generate().private_bytes(
        Encoding.PEM, PrivateFormat.PKCS8, NoEncryption()
    )
    with pytest.raises(RobotError, match="was not made by `t2 keys init`"):
        CertificateAuthority.load(certificate, other_kind, no_passphrase)
