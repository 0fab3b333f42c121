"""Flip a rocker switch."""
