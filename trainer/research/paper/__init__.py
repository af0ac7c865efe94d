"""The published tables and figures, computed again on the published data, beside the published numbers."""
