"""Additive attention for innerattn: registration. This module does not import torch."""

from innerattn.config import register_attention

register_attention("additive", "additive_attention.network:AdditiveAttention")
