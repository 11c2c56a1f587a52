"""Content of certificates, and keys that do not match."""

from datetime import timedelta
from ipaddress import ip_address

import pytest
from cryptography import x509
from cryptography.x509.oid import ExtendedKeyUsageOID, ExtensionOID

from cli.keys.ca import CertificateAuthority, certificate_from, certificate_pem, key_pem
from cli.keys.member_list import DAY_S, profile
from cli.keys.members import Profile
from t2.errors import T2Error

SERVER, CLIENT = ExtendedKeyUsageOID.SERVER_AUTH, ExtendedKeyUsageOID.CLIENT_AUTH
SPAN = 1.8e9, 1.8e9 + 10 * DAY_S
ROBOT = profile("robot", "001", (), ("10.7.5.220", "robot.lan"))
DRIVER = profile("driver", "anna", ("001",))


@pytest.fixture(scope="module")
def authority() -> CertificateAuthority:
    return CertificateAuthority.create("berlin", SPAN)


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
    found.verify_directly_issued_by(found)


@pytest.mark.parametrize(
    ("who", "usages", "names"),
    [
        (ROBOT, [SERVER, CLIENT], [
            x509.IPAddress(ip_address("10.7.5.220")), x509.DNSName("robot.lan"),
            x509.DNSName("localhost"), x509.IPAddress(ip_address("127.0.0.1")),
        ]),
        (DRIVER, [CLIENT], []),
    ],
)  # fmt: skip
def test_every_certificate(
    authority: CertificateAuthority, who: Profile, usages: list[object], names: list[object]
) -> None:
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
    extended = found.extensions.get_extension_for_class(x509.ExtendedKeyUsage)
    assert list(extended.value) == usages
    alternative = [
        e.value for e in found.extensions if e.oid == ExtensionOID.SUBJECT_ALTERNATIVE_NAME
    ]
    assert [name for value in alternative for name in value] == names
    member = made.member
    assert found.subject.rfc4514_string() == f"CN={member.common_name}"
    assert member.common_name == f"{who.label}.{found.serial_number:040x}"[: len(who.label) + 9]
    assert member.expires == found.not_valid_after_utc


def test_invalid_keys(authority: CertificateAuthority) -> None:
    certificate = certificate_pem(authority.certificate)
    stranger = CertificateAuthority.create("berlin", SPAN)
    with pytest.raises(T2Error, match="does not match the certificate"):
        CertificateAuthority.load(certificate, key_pem(stranger.key), bytes)
    with pytest.raises(T2Error, match="cannot read"):
        CertificateAuthority.load(certificate, b"no key", bytes)
    with pytest.raises(T2Error, match="invalid certificate"):
        CertificateAuthority.load(b"-----BEGIN", key_pem(stranger.key), bytes)
