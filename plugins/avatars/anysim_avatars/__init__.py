"""Avatars: people who walk, sit, talk, look and reach in the worlds of anysim."""
