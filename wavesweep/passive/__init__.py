"""Passivity of the wave channel and of the hand's port, and stability for all passive hands."""
