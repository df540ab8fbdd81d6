"""The report's figures, drawn from what was measured and from nothing else.

Lines are means over scenarios, bands their intervals of 95 %. Every hue is one of Okabe and Ito's, the same for the same thing
in all figures.
"""
