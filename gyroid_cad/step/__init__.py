"""STEP files as text: entities, bodies and products from arrays; no kernel is asked."""
