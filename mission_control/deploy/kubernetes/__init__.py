"""The parts of a mission as a folder for `kubectl apply -k`.

A mission ends, and so do its world and its robots: they are Jobs, which are started again when they fail and not when they
are done, and of which there are never two at a time. The router, whom others call, is a Deployment with a Service; nobody else
needs one. What a robot learned and what the world keeps is on a volume claim of its own. A namespace holds one mission: nobody
in it is spoken to from outside, nor speaks to anybody outside but the cluster's name server.
"""
