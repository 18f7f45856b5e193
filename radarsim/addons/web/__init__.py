"""The commander: a web page to see robots, drive them and explain what they sense.

It is a client of a USARSim server over TCP, as any other, and serves its page by HTTP.

How messages flow: what a page asks for is received by ``program``, checked by
``requests`` and acted upon by ``commander``, which hands it to ``robots``, to
``activities`` (tasks and maps, done with ``algorithms``) or to ``recording``. Reports
of the server come to ``robots`` from two sides: from ``server_link``, which watches all
of them, and from the connections of the commander's own (``own_robot``). Each becomes
part of a ``robot_view``. Changes are sent by ``viewers``: texts at once, and
all that moves by the next frame.
"""
