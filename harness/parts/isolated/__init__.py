"""FMUs in a process of their own: the part, its process, the line between both, and what runs at the other end."""
