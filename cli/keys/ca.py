"""The certificate authority: its own certificate, and those that it signs.

Keys use the curve P-256 and signatures ECDSA with SHA-256. Every TLS library supports them, also
rustls, which Zenoh uses.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from ipaddress import ip_address

from cryptography import x509
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import (
    BestAvailableEncryption,
    Encoding,
    NoEncryption,
    PrivateFormat,
    load_pem_private_key,
)
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from cli.keys.profile import Profile, Span, is_ip
from common.errors import RobotError
from common.members import Member

Extensions = Sequence[tuple[x509.ExtensionType, bool]]  # each with its critical flag


@dataclass(frozen=True, slots=True)
class Issued:
    """A new certificate: the content of its files, and its entry in the member list."""

    certificate: bytes  # PEM
    private_key: bytes  # PEM
    member: Member


@dataclass(frozen=True, slots=True)
class CertificateAuthority:
    """Signs certificates."""

    certificate: x509.Certificate
    key: ec.EllipticCurvePrivateKey

    @classmethod
    def create(cls, site: str, span: Span) -> "CertificateAuthority":
        """Create the authority of a site."""
        key = ec.generate_private_key(ec.SECP256R1())
        name = _name(f"T2 CA of {site}")
        extensions: Extensions = [
            (x509.BasicConstraints(ca=True, path_length=0), True),
            (_key_usage(signs_certificates=True), True),
            (x509.SubjectKeyIdentifier.from_public_key(key.public_key()), False),
        ]
        serial = x509.random_serial_number()
        signed = _signed(name, key.public_key(), serial, span, extensions, issuer=name, by=key)
        return cls(signed, key)

    @classmethod
    def load(
        cls, certificate: bytes, key: bytes, passphrase: Callable[[], bytes]
    ) -> "CertificateAuthority":
        """Read the authority from PEM; call ``passphrase`` if the key is encrypted.

        Raise ``RobotError`` if the passphrase is wrong, or key and certificate do not match.
        """
        loaded = certificate_from(certificate)
        try:
            private = load_pem_private_key(key, passphrase() if _is_encrypted(key) else None)
        except ValueError:
            raise RobotError("cannot read the CA's key: wrong passphrase, or not a key") from None
        if not isinstance(private, ec.EllipticCurvePrivateKey):
            raise RobotError("the CA's key was not made by `t2 keys init`")
        if private.public_key() != loaded.public_key():
            raise RobotError("the CA's key does not match the certificate in ca.pem")
        return cls(loaded, private)

    def issue(self, profile: Profile, span: Span) -> Issued:
        """Sign a certificate for a new key."""
        key = ec.generate_private_key(ec.SECP256R1())
        serial = x509.random_serial_number()
        name = profile.common_name(serial)
        authority = x509.SubjectKeyIdentifier.from_public_key(self.key.public_key())
        extensions: Extensions = [
            (x509.BasicConstraints(ca=False, path_length=None), True),
            (_key_usage(signs_certificates=False), True),
            (x509.ExtendedKeyUsage(_usages(profile)), False),
            (x509.AuthorityKeyIdentifier.from_issuer_subject_key_identifier(authority), False),
            *((names, False) for names in _alternative_names(profile)),
        ]
        signed = _signed(
            _name(name), key.public_key(), serial, span, extensions,
            issuer=self.certificate.subject, by=self.key,
        )  # fmt: skip
        member = Member(
            common_name=name, role=profile.role, name=profile.name, robots=profile.robots,
            sources=profile.sources, addresses=profile.addresses,
            expires=signed.not_valid_after_utc,
        )  # fmt: skip
        return Issued(certificate_pem(signed), key_pem(key), member)


def certificate_from(pem: bytes) -> x509.Certificate:
    """Read a certificate; raise ``RobotError`` if it is invalid."""
    try:
        return x509.load_pem_x509_certificate(pem)
    except ValueError as error:
        raise RobotError(f"invalid certificate: {error}") from None


def certificate_pem(certificate: x509.Certificate) -> bytes:
    """Return a certificate as PEM."""
    return certificate.public_bytes(Encoding.PEM)


def key_pem(key: ec.EllipticCurvePrivateKey, passphrase: bytes = b"") -> bytes:
    """Return a private key as PEM, encrypted if there is a passphrase."""
    protection = BestAvailableEncryption(passphrase) if passphrase else NoEncryption()
    return key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, protection)


def _signed(
    name: x509.Name,
    public_key: ec.EllipticCurvePublicKey,
    serial: int,
    span: Span,
    extensions: Extensions,
    *,
    issuer: x509.Name,
    by: ec.EllipticCurvePrivateKey,
) -> x509.Certificate:
    builder = x509.CertificateBuilder(issuer, name, public_key, serial)
    builder = builder.not_valid_before(datetime.fromtimestamp(span.begins_s, UTC))
    builder = builder.not_valid_after(datetime.fromtimestamp(span.ends_s, UTC))
    for extension, critical in extensions:
        builder = builder.add_extension(extension, critical)
    return builder.sign(by, hashes.SHA256())


def _name(common_name: str) -> x509.Name:
    return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, common_name)])


def _key_usage(*, signs_certificates: bool) -> x509.KeyUsage:
    return x509.KeyUsage(
        digital_signature=not signs_certificates, key_cert_sign=signs_certificates,
        crl_sign=signs_certificates, content_commitment=False, key_encipherment=False,
        data_encipherment=False, key_agreement=False, encipher_only=False, decipher_only=False,
    )  # fmt: skip


def _usages(profile: Profile) -> list[x509.ObjectIdentifier]:
    client = [ExtendedKeyUsageOID.CLIENT_AUTH]
    return [ExtendedKeyUsageOID.SERVER_AUTH, *client] if profile.listens else client


def _alternative_names(profile: Profile) -> list[x509.SubjectAlternativeName]:
    names = [
        x509.IPAddress(ip_address(each)) if is_ip(each) else x509.DNSName(each)
        for each in profile.addresses
    ]
    return [x509.SubjectAlternativeName(names)] if names else []


def _is_encrypted(key: bytes) -> bool:
    return b"ENCRYPTED" in key
