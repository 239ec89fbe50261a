"""Exceptions that a user of innerattn can catch; each message is one line."""


class InnerattnError(Exception):
    """Base of all errors that innerattn raises on purpose."""


class ConfigError(InnerattnError, ValueError):
    """A configuration, preset or scenario is not valid; the message names the key."""


class RunError(InnerattnError):
    """A run folder is missing, foreign, damaged, or already there."""
