"""The certificate authority: its own certificate, and those that it signs.

Keys use the curve P-256 and signatures ECDSA with SHA-256. Every TLS library supports them, also
rustls, which Zenoh uses.
"""

from collections.abc import Callable, Iterable
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
from msgspec.structs import asdict

from cli.keys.member_list import Span, common_name, is_ip
from cli.keys.members import Member, Profile
from t2.errors import T2Error


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
        identifier = x509.SubjectKeyIdentifier.from_public_key(key.public_key())
        unsigned = _unsigned(name, name, key, span, [identifier], is_ca=True)
        numbered = unsigned.serial_number(x509.random_serial_number())
        return cls(numbered.sign(key, hashes.SHA256()), key)

    @classmethod
    def load(
        cls, certificate: bytes, key: bytes, passphrase: Callable[[], bytes]
    ) -> "CertificateAuthority":
        """Read the authority from PEM; call ``passphrase`` if the key is encrypted.

        Raise ``T2Error`` if the passphrase is wrong, or key and certificate do not match.
        """
        loaded = certificate_from(certificate)
        try:
            private = load_pem_private_key(key, passphrase() if b"ENCRYPTED" in key else None)
        except ValueError:
            raise T2Error("cannot read the CA's key: wrong passphrase, or not a key") from None
        matches = private.public_key() == loaded.public_key()
        if not matches or not isinstance(private, ec.EllipticCurvePrivateKey):
            raise T2Error("the CA's key does not match the certificate in ca.pem")
        return cls(loaded, private)

    def issue(self, profile: Profile, span: Span) -> Issued:
        """Sign a certificate for a new key."""
        key = ec.generate_private_key(ec.SECP256R1())
        serial = x509.random_serial_number()
        name = common_name(profile, serial)
        authority = x509.SubjectKeyIdentifier.from_public_key(self.key.public_key())
        server = [ExtendedKeyUsageOID.SERVER_AUTH] if profile.listens else []
        extensions = [
            x509.ExtendedKeyUsage([*server, ExtendedKeyUsageOID.CLIENT_AUTH]),
            x509.AuthorityKeyIdentifier.from_issuer_subject_key_identifier(authority),
            *_alternative_names(profile),
        ]
        unsigned = _unsigned(
            self.certificate.subject, _name(name), key, span, extensions, is_ca=False
        )
        signed = unsigned.serial_number(serial).sign(self.key, hashes.SHA256())
        member = Member(**asdict(profile), common_name=name, expires=signed.not_valid_after_utc)
        return Issued(certificate_pem(signed), key_pem(key), member)


def certificate_from(pem: bytes) -> x509.Certificate:
    """Read a certificate; raise ``T2Error`` if it is invalid."""
    try:
        return x509.load_pem_x509_certificate(pem)
    except ValueError as error:
        raise T2Error(f"invalid certificate: {error}") from None


def certificate_pem(certificate: x509.Certificate) -> bytes:
    """Return a certificate as PEM."""
    return certificate.public_bytes(Encoding.PEM)


def key_pem(key: ec.EllipticCurvePrivateKey, passphrase: bytes = b"") -> bytes:
    """Return a private key as PEM, encrypted if there is a passphrase."""
    protection = BestAvailableEncryption(passphrase) if passphrase else NoEncryption()
    return key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, protection)


def _unsigned(
    issuer: x509.Name,
    name: x509.Name,
    key: ec.EllipticCurvePrivateKey,
    span: Span,
    extensions: Iterable[x509.ExtensionType],
    *,
    is_ca: bool,
) -> x509.CertificateBuilder:
    """Return a certificate without serial number; only what limits its use is critical."""
    usage = x509.KeyUsage(
        digital_signature=not is_ca, key_cert_sign=is_ca, crl_sign=is_ca,
        content_commitment=False, key_encipherment=False, data_encipherment=False,
        key_agreement=False, encipher_only=False, decipher_only=False,
    )  # fmt: skip
    builder = x509.CertificateBuilder(issuer, name, key.public_key())
    builder = builder.not_valid_before(datetime.fromtimestamp(span[0], UTC))
    builder = builder.not_valid_after(datetime.fromtimestamp(span[1], UTC))
    constraints = x509.BasicConstraints(ca=is_ca, path_length=0 if is_ca else None)
    builder = builder.add_extension(constraints, critical=True)
    builder = builder.add_extension(usage, critical=True)
    for extension in extensions:
        builder = builder.add_extension(extension, critical=False)
    return builder


def _name(common_name: str) -> x509.Name:
    return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, common_name)])


def _alternative_names(profile: Profile) -> list[x509.SubjectAlternativeName]:
    names = [
        x509.IPAddress(ip_address(each)) if is_ip(each) else x509.DNSName(each)
        for each in profile.addresses
    ]
    return [x509.SubjectAlternativeName(names)] if names else []
