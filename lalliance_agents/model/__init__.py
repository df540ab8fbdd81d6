"""The formal model of L-ALLIANCE, executable (the Appendix of the paper).

Everything here is pure: no clock is read (`now` is handed in), no message is sent (commands are returned), no randomness
is drawn but from a source handed in. One formula is one function in `equations`; the records around them hold only what
a formula needs to look back at: who was heard when (`hearing`), what attempts took (`monitor`), how a motivation has
grown (`motivation`). `mind` puts them together: events in, commands out, each decision with the factors behind it.
"""
