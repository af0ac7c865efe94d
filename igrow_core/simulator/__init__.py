"""The three-stage simulator, climate -> growth -> yield, in its variants `hybrid` and `network`."""
