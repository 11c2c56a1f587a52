"""Tests of the wire: frames, and datagrams made of them."""
