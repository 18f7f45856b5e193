"""The commander: a web page to see robots, drive them and explain their readings.

The commander is an ordinary TCP client of a USARSim server, and serves a page by HTTP.

Requests of a page are received by ``program``, checked by ``requests`` and executed by
``commander``, which passes them to ``robots``, to ``activities`` (tasks and maps, run
by ``algorithms``) or to ``recording``. Reports of the server reach ``robots`` over the
connection that watches all robots (``server_link``), and over the connection of each
robot that the commander spawned (``own_robot``). They update a ``robot_view``. Changes
are sent by ``viewers``: text messages at once, and moving objects with the next frame.
"""
