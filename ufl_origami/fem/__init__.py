"""The FEM model: an independent Koiter shell of second order with creases, its forms in UFL.

It shares with the DDG model the sheet, the numbering of unknowns, loads and conditions, and no
shell or crease code.
"""
