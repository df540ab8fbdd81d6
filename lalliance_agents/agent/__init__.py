"""The robot as an asyncio program: it receives, feeds its mind, ticks, and performs what the mind decides."""
