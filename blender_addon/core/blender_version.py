# SPDX-License-Identifier: GPL-3.0-or-later
"""What differs between the supported versions of Blender.

Nothing else asks for the version but the farm's script, which runs alone.
"""

import bpy

# Before 5.0 the compositor's tree is part of the scene and ends in a Composite node; since then it is a node group.
SCENE_OWNS_COMPOSITOR = bpy.app.version < (5, 0)
# Before 5.0 Worlds and materials have a switch for their nodes; since then they always use them.
NODES_ARE_OPTIONAL = bpy.app.version < (5, 0)
# Since 5.0 most settings of compositor nodes are sockets.
COMPOSITOR_SETTINGS_ARE_SOCKETS = bpy.app.version >= (5, 0)
# Before 5.0 the values of registered properties are custom properties of the same name; since then they lie apart.
PROPERTIES_ARE_APART = bpy.app.version >= (5, 0)
# Since 5.2 Cycles counts the rows of a texture in OSL from the bottom.
OSL_COUNTS_ROWS_UPWARDS = bpy.app.version >= (5, 2)

# Node groups are built for one version, which this text names.
SERIES = f"{bpy.app.version[0]}.{bpy.app.version[1]}"
