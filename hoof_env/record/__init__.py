"""Instants and episodes as data: their fields, columns and units, below the pictures that show them."""
