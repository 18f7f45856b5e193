"""The commander: a web page to see robots, drive them and explain what they sense.

It is a client of a USARSim server over TCP, as any other, and serves its page by HTTP.
What a browser sends passes ``doors`` (who may come in) and ``requests`` (what it may
say) before ``commander`` acts upon it; ``viewer`` is one browser, ``own_robot`` one
robot that the commander spawned.
"""
